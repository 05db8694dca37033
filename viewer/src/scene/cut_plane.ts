// Where the bodies are cut open: an axis of the scene, the side that is taken away, and how far.

import * as THREE from "three";

import type { Axis } from "../store";

/** Takes away the side that faces the viewer; share is the part of the extent that goes, 0..1. */
export function cutPlane(bounds: THREE.Box3, axis: Axis, share: number, towardsViewer: THREE.Vector3): THREE.Plane {
  const sign = towardsViewer[axis] < 0 ? -1 : 1;
  const normal = new THREE.Vector3();
  normal[axis] = sign;
  const [near, far] = sign > 0 ? [bounds.max, bounds.min] : [bounds.min, bounds.max];
  // What lies beyond the plane is removed; three's constant is the offset with the other sign.
  return new THREE.Plane(normal, -sign * (near[axis] + share * (far[axis] - near[axis])));
}

/** The horizontal axis that looks most towards the viewer. */
export function facingAxis(towardsViewer: THREE.Vector3): Axis {
  return Math.abs(towardsViewer.x) > Math.abs(towardsViewer.y) ? "x" : "y";
}
