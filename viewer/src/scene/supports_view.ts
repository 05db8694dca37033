// Markers at the supported nodes.

import * as THREE from "three";

import type { BodyArrays } from "../net/protocol";

export const SUPPORT_COLOR = 0x5cc8ff;
/** Radius of a marker over the size of the body. */
const MARKER_SIZE = 0.009;

export class SupportsView {
  readonly markers: THREE.InstancedMesh<THREE.OctahedronGeometry, THREE.MeshStandardMaterial>;

  constructor(arrays: BodyArrays, size: number) {
    const geometry = new THREE.OctahedronGeometry(MARKER_SIZE * size);
    const material = new THREE.MeshStandardMaterial({ color: SUPPORT_COLOR, roughness: 0.5, flatShading: true });
    this.markers = new THREE.InstancedMesh(geometry, material, arrays.fixed_nodes.length);
    const matrix = new THREE.Matrix4();
    arrays.fixed_nodes.forEach((node, i) => {
      const [x, y, z] = arrays.nodes.subarray(3 * node, 3 * node + 3);
      this.markers.setMatrixAt(i, matrix.makeTranslation(x!, y!, z!));
    });
    this.markers.frustumCulled = false;
  }

  dispose(): void {
    this.markers.geometry.dispose();
    this.markers.material.dispose();
    this.markers.dispose();
  }
}
