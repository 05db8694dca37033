// A dot on the node whose displacement is plotted.

import * as THREE from "three";

import type { Surface } from "./surface";

const COLOR = 0xffffff;
/** Over the size of the body. */
const RADIUS = 0.007;

export class WatchedView {
  readonly dot: THREE.Mesh<THREE.SphereGeometry, THREE.MeshBasicMaterial>;

  constructor(private readonly surface: Surface, size: number) {
    const material = new THREE.MeshBasicMaterial({ color: COLOR, depthTest: false, transparent: true });
    this.dot = new THREE.Mesh(new THREE.SphereGeometry(RADIUS * size, 20, 12), material);
    this.dot.renderOrder = 2;
    this.dot.visible = false;
  }

  /** row is that of a surface node, null where nothing is watched. */
  update(row: number | null): void {
    this.dot.visible = row !== null;
    if (row !== null) this.dot.position.fromArray(this.surface.shown, 3 * row);
  }
}
