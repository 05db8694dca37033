// The edges of the areas that a tool touches, a ring for each place.

import * as THREE from "three";

import type { SurfaceSpot } from "./tool_shape";

const COLOR = 0xfff3d6;
const FORWARD = new THREE.Vector3(0, 0, 1);

/** Where a ring lies, and its radius in m. */
export interface RingPlace extends SurfaceSpot {
  radius: number;
}

export class ContactRings {
  readonly group = new THREE.Group();
  /** As many as there have been places at once: three a body at most. */
  private readonly rings: THREE.Mesh[] = [];
  private readonly geometry = new THREE.RingGeometry(0.93, 1, 64);
  private readonly material = new THREE.MeshBasicMaterial({
    color: COLOR,
    side: THREE.DoubleSide,
    transparent: true,
    opacity: 0.85,
    depthTest: false,
  });

  update(places: readonly RingPlace[]): void {
    while (this.rings.length < places.length) {
      const ring = new THREE.Mesh(this.geometry, this.material);
      this.rings.push(ring);
      this.group.add(ring);
    }
    this.rings.forEach((ring, i) => {
      const place = places[i];
      ring.visible = place !== undefined;
      if (!place) return;
      ring.position.copy(place.point);
      ring.quaternion.setFromUnitVectors(FORWARD, place.normal);
      ring.scale.setScalar(place.radius);
    });
  }
}
