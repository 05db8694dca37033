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

/** Distance from the target, m, along a unit vector towards the viewer, with the target in the middle of the region. */
export function fitDistance(
  surface: Surface,
  target: THREE.Vector3,
  towardsViewer: THREE.Vector3,
  camera: THREE.PerspectiveCamera,
  region: Region,
  pictureHeight: number,
): number {
  const right = new THREE.Vector3().crossVectors(camera.up, towardsViewer).normalize();
  const up = new THREE.Vector3().crossVectors(towardsViewer, right);
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
