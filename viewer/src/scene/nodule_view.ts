// The ball of a nodule that is placed in a body.

import * as THREE from "three";

import type { Nodule } from "../net/setup_messages";

const NODULE_COLOR = 0xd55e00;

export class NoduleView {
  readonly mesh = new THREE.Mesh(
    new THREE.SphereGeometry(1, 48, 32),
    new THREE.MeshStandardMaterial({ color: NODULE_COLOR, roughness: 0.5 }),
  );

  constructor() {
    this.mesh.visible = false;
  }

  show(nodule: Nodule | null): void {
    this.mesh.visible = nodule !== null;
    if (!nodule) return;
    this.mesh.position.set(...nodule.center);
    this.mesh.scale.setScalar(nodule.radius);
    this.mesh.updateMatrixWorld();
  }

  /** Whether a ray meets it. */
  isMet(raycaster: THREE.Raycaster): boolean {
    return this.mesh.visible && raycaster.intersectObject(this.mesh, false).length > 0;
  }
}
