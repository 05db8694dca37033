// A soft dark patch under the body, so that it does not float.

import * as THREE from "three";

const TEXTURE_SIZE = 128;

export function createGroundShadow(
  bounds: THREE.Box3,
  size: number,
): THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial> {
  const extent = bounds.getSize(new THREE.Vector3());
  const geometry = new THREE.PlaneGeometry(extent.x + 0.7 * size, extent.y + 0.7 * size);
  const material = new THREE.MeshBasicMaterial({ map: radialTexture(), transparent: true, depthWrite: false });
  const mesh = new THREE.Mesh(geometry, material);
  bounds.getCenter(mesh.position);
  mesh.position.z = bounds.min.z - 0.01 * size;
  mesh.renderOrder = -1;
  return mesh;
}

function radialTexture(): THREE.CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = TEXTURE_SIZE;
  const context = canvas.getContext("2d")!;
  const half = TEXTURE_SIZE / 2;
  const gradient = context.createRadialGradient(half, half, 0, half, half, half);
  gradient.addColorStop(0, "rgba(0, 0, 0, 0.5)");
  gradient.addColorStop(0.5, "rgba(0, 0, 0, 0.28)");
  gradient.addColorStop(1, "rgba(0, 0, 0, 0)");
  context.fillStyle = gradient;
  context.fillRect(0, 0, TEXTURE_SIZE, TEXTURE_SIZE);
  return new THREE.CanvasTexture(canvas);
}
