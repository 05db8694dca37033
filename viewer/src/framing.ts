// Where the picture is free of what is written over it, and how far the camera must stand so that all of a body is
// seen there.

import * as THREE from "three";

import type { Surface } from "./surface";

/** Room around the body for its deformation. */
const MARGIN = 1.1;

/** Part of the picture in CSS pixels from its top left corner. */
export interface Region {
  left: number;
  top: number;
  width: number;
  height: number;
}

/**
 * What a box in a corner leaves free: beside it or above or below it, whichever is larger. Taken for each of the
 * overlays in turn.
 */
export function freeRegion(canvas: HTMLElement, overlays: HTMLElement[]): Region {
  const stage = canvas.getBoundingClientRect();
  let [left, top, right, bottom] = [0, 0, stage.width, stage.height];
  for (const overlay of overlays) {
    const box = overlay.getBoundingClientRect();
    if (box.width === 0 || box.height === 0) continue;
    const [x0, x1, y0, y1] = [box.left - stage.left, box.right - stage.left, box.top - stage.top, box.bottom - stage.top];
    if (x1 <= left || x0 >= right || y1 <= top || y0 >= bottom) continue;
    const [width, height] = [right - left, bottom - top];
    const areas = [(right - x1) * height, (x0 - left) * height, (bottom - y1) * width, (y0 - top) * width];
    const largest = areas.indexOf(Math.max(...areas));
    if (largest === 0) left = x1;
    else if (largest === 1) right = x0;
    else if (largest === 2) top = y1;
    else bottom = y0;
  }
  return { left, top, width: right - left, height: bottom - top };
}

/** Moves a target across the line of sight until the body reaches as far to both sides of it, seen from a distance. */
export function centreAcross(
  surface: Surface,
  target: THREE.Vector3,
  towardsViewer: THREE.Vector3,
  camera: THREE.PerspectiveCamera,
  distance: number,
): void {
  const point = new THREE.Vector3();
  for (const axis of across(camera, towardsViewer)) {
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < surface.rest.length; i += 3) {
      point.fromArray(surface.rest, i).sub(target);
      const seen = (point.dot(axis) * distance) / (distance - point.dot(towardsViewer));
      low = Math.min(low, seen);
      high = Math.max(high, seen);
    }
    target.addScaledVector(axis, (low + high) / 2);
  }
}

/** Unit vectors to the right and up as seen. */
function across(camera: THREE.Camera, towardsViewer: THREE.Vector3): [THREE.Vector3, THREE.Vector3] {
  const right = new THREE.Vector3().crossVectors(camera.up, towardsViewer).normalize();
  return [right, new THREE.Vector3().crossVectors(towardsViewer, right)];
}

/** Distance from the target, m, along a unit vector towards the viewer, with the target in the middle of the region. */
export function fitDistance(
  surface: Surface,
  target: THREE.Vector3,
  towardsViewer: THREE.Vector3,
  camera: THREE.PerspectiveCamera,
  region: Region,
  pictureHeight: number,
): number {
  const [right, up] = across(camera, towardsViewer);
  const tangent = Math.tan(THREE.MathUtils.degToRad(camera.fov) / 2) / (MARGIN * pictureHeight);
  const [tangentRight, tangentUp] = [tangent * region.width, tangent * region.height];
  const point = new THREE.Vector3();
  let distance = 0;
  for (let i = 0; i < surface.rest.length; i += 3) {
    point.fromArray(surface.rest, i).sub(target);
    const needed = Math.max(Math.abs(point.dot(right)) / tangentRight, Math.abs(point.dot(up)) / tangentUp);
    distance = Math.max(distance, needed + point.dot(towardsViewer));
  }
  return distance;
}
