// Release of memory of the graphics card, which three.js keeps until it is asked.

import * as THREE from "three";

/** Takes an object out of its scene and frees what it and its parts are drawn with; a texture only where it is a map. */
export function release(root: THREE.Object3D): void {
  root.removeFromParent();
  root.traverse((part) => {
    if (part instanceof THREE.InstancedMesh) part.dispose();
    if (!(part instanceof THREE.Mesh || part instanceof THREE.Line || part instanceof THREE.Sprite)) return;
    const { geometry, material } = part as THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial>;
    geometry.dispose();
    material.map?.dispose();
    material.dispose();
  });
}
