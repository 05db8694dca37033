// Where the body is cut open: an axis, the side that is taken away, and how far.

import * as THREE from "three";

export type Axis = "x" | "y" | "z";

export class CutPlane {
  /** Points from what stays to what is removed. */
  readonly normal = new THREE.Vector3(0, -1, 0);
  offset = 0;

  constructor(private readonly bounds: THREE.Box3) {}

  /** Takes away the side that faces the viewer; share is the part of the extent that goes, 0..1. */
  set(axis: Axis, share: number, towardsViewer: THREE.Vector3): void {
    const sign = towardsViewer[axis] < 0 ? -1 : 1;
    this.normal.set(0, 0, 0);
    this.normal[axis] = sign;
    const [near, far] = sign > 0 ? [this.bounds.max, this.bounds.min] : [this.bounds.min, this.bounds.max];
    this.offset = sign * (near[axis] + share * (far[axis] - near[axis]));
  }
}

/** The horizontal axis that looks most towards the viewer. */
export function facingAxis(towardsViewer: THREE.Vector3): Axis {
  return Math.abs(towardsViewer.x) > Math.abs(towardsViewer.y) ? "x" : "y";
}
