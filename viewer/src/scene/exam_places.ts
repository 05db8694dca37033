// Dots at the places of an exam, one of which may be above a nodule.

import * as THREE from "three";

import type { Vec3 } from "../net/protocol";

const COLOR = 0x1673b8;
/** Over the size of the scene. */
const RADIUS = 0.01;

export class ExamPlaces {
  readonly group = new THREE.Group();
  // Seen through the tool, which would hide them.
  private readonly material = new THREE.MeshBasicMaterial({ color: COLOR, depthTest: false, transparent: true, opacity: 0.85 });
  private readonly geometry = new THREE.SphereGeometry(1, 20, 12);

  show(places: readonly Vec3[], size: number): void {
    this.group.clear();
    for (const place of places) {
      const dot = new THREE.Mesh(this.geometry, this.material);
      dot.position.set(...place);
      dot.scale.setScalar(RADIUS * size);
      dot.renderOrder = 2;
      this.group.add(dot);
    }
  }
}
