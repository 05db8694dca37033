// Wire frame of the undeformed shape, drawn over the deformed solid (Fig. 4 of the paper).

import * as THREE from "three";

import type { Surface } from "./surface";

export class WireframeView {
  readonly lines: THREE.LineSegments<THREE.BufferGeometry, THREE.LineBasicMaterial>;

  constructor(surface: Surface) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(surface.rest, 3));
    geometry.setIndex(new THREE.BufferAttribute(uniqueEdges(surface.triangles), 1));
    const material = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.24, depthWrite: false });
    this.lines = new THREE.LineSegments(geometry, material);
    this.lines.frustumCulled = false;
  }
}

/** Each edge once: on a closed surface it is the one that runs upwards in one of its two triangles. */
function uniqueEdges(triangles: Uint32Array): Uint32Array {
  const edges: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    for (let side = 0; side < 3; side++) {
      const a = triangles[t + side]!;
      const b = triangles[t + ((side + 1) % 3)]!;
      if (a < b) edges.push(a, b);
    }
  }
  return new Uint32Array(edges);
}
