// Markers at the supported nodes.

import * as THREE from "three";

import type { BodyArrays } from "../net/protocol";

export const SUPPORT_COLOR = 0x5cc8ff;
/** Radius of a marker over the size of the body. */
const MARKER_SIZE = 0.009;

export class SupportsView {
  readonly markers: THREE.InstancedMesh<THREE.OctahedronGeometry, THREE.MeshStandardMaterial>;

  constructor(private readonly arrays: BodyArrays, size: number) {
    const geometry = new THREE.OctahedronGeometry(MARKER_SIZE * size);
    const material = new THREE.MeshStandardMaterial({ color: SUPPORT_COLOR, roughness: 0.5, flatShading: true });
    this.markers = new THREE.InstancedMesh(geometry, material, arrays.fixed_nodes.length);
    this.markers.frustumCulled = false;
    this.cut(null);
  }

  /** Leaves out those beyond a plane at rest. */
  cut(plane: { normal: THREE.Vector3; offset: number } | null): void {
    const { nodes, fixed_nodes } = this.arrays;
    const [matrix, place] = [new THREE.Matrix4(), new THREE.Vector3()];
    let count = 0;
    for (const node of fixed_nodes) {
      place.fromArray(nodes, 3 * node);
      if (plane && place.dot(plane.normal) > plane.offset) continue;
      this.markers.setMatrixAt(count, matrix.makeTranslation(place));
      count += 1;
    }
    this.markers.count = count;
    this.markers.instanceMatrix.needsUpdate = true;
  }
}
