// How far the camera must stand so that all of a body is seen.

import * as THREE from "three";

import type { Surface } from "./surface";

/** Room around the body, for its deformation and for what is written over the picture. */
const MARGIN = 1.22;

/** Distance from the target, m, along a unit vector towards the viewer. */
export function fitDistance(
  surface: Surface,
  target: THREE.Vector3,
  towardsViewer: THREE.Vector3,
  camera: THREE.PerspectiveCamera,
): number {
  const right = new THREE.Vector3().crossVectors(camera.up, towardsViewer).normalize();
  const up = new THREE.Vector3().crossVectors(towardsViewer, right);
  const tangentUp = Math.tan(THREE.MathUtils.degToRad(camera.fov) / 2) / MARGIN;
  const tangentRight = tangentUp * camera.aspect;
  const point = new THREE.Vector3();
  let distance = 0;
  for (let i = 0; i < surface.rest.length; i += 3) {
    point.fromArray(surface.rest, i).sub(target);
    const needed = Math.max(Math.abs(point.dot(right)) / tangentRight, Math.abs(point.dot(up)) / tangentUp);
    distance = Math.max(distance, needed + point.dot(towardsViewer));
  }
  return distance;
}
