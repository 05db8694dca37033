// Where the picture is free of what is written over it, and how far the camera must stand so that all bodies are
// seen there.

import * as THREE from "three";

/** Room around body and tool, for deformation and the force arrow. */
const MARGIN = 1.1;

/** Part of the picture in CSS pixels from its top left corner. */
export interface Region {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** In a small window that the overlays leave less of than this the body goes under them. */
const FREE_SHARE_MIN = 0.15;
const NOTHING: Region = { left: 0, top: 0, width: 0, height: 0 };

/** The largest part of the canvas that is beside all overlays. */
export function freeRegion(canvas: HTMLElement, overlays: HTMLElement[]): Region {
  const stage = canvas.getBoundingClientRect();
  const boxes = overlays.map((overlay) => {
    const { left, top, width, height } = overlay.getBoundingClientRect();
    return { left: left - stage.left, top: top - stage.top, width, height };
  });
  const whole = { left: 0, top: 0, width: stage.width, height: stage.height };
  const free = largestBeside(whole, boxes);
  return free.width * free.height < FREE_SHARE_MIN * whole.width * whole.height ? whole : free;
}

/** Each box leaves what is to one of its four sides; all choices are tried, for there are three boxes or so. */
function largestBeside(region: Region, boxes: Region[]): Region {
  const [right, bottom] = [region.left + region.width, region.top + region.height];
  const place = boxes.findIndex(
    ({ left, top, width, height }) =>
      left < right && top < bottom && left + width > region.left && top + height > region.top,
  );
  if (place < 0) return region;
  const box = boxes[place]!;
  const [boxRight, boxBottom] = [box.left + box.width, box.top + box.height];
  const rest = boxes.slice(place + 1);
  return [
    { ...region, left: boxRight, width: right - boxRight },
    { ...region, width: box.left - region.left },
    { ...region, top: boxBottom, height: bottom - boxBottom },
    { ...region, height: box.top - region.top },
  ]
    .filter(({ width, height }) => width > 0 && height > 0)
    .map((side) => largestBeside(side, rest))
    .reduce((best, side) => (side.width * side.height > best.width * best.height ? side : best), NOTHING);
}

/** Moves a target across the line of sight until points reach as far to both sides of it, seen from a distance. */
export function centreAcross(
  points: Float32Array,
  target: THREE.Vector3,
  towardsViewer: THREE.Vector3,
  camera: THREE.PerspectiveCamera,
  distance: number,
): void {
  const point = new THREE.Vector3();
  for (const axis of across(camera, towardsViewer)) {
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < points.length; i += 3) {
      point.fromArray(points, i).sub(target);
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

/**
 * Distance of the camera from the target, m, along a unit vector towards the viewer, with the target in the middle of the region and
 * room for the tool, m, all around.
 */
export function fitDistance(
  points: Float32Array,
  target: THREE.Vector3,
  towardsViewer: THREE.Vector3,
  camera: THREE.PerspectiveCamera,
  room: number,
  region: Region,
  pictureHeight: number,
): number {
  const [right, up] = across(camera, towardsViewer);
  const tangent = Math.tan(THREE.MathUtils.degToRad(camera.fov) / 2) / (MARGIN * pictureHeight);
  const [tangentRight, tangentUp] = [tangent * region.width, tangent * region.height];
  const point = new THREE.Vector3();
  let distance = 0;
  for (let i = 0; i < points.length; i += 3) {
    point.fromArray(points, i).sub(target);
    const [sideways, upwards] = [Math.abs(point.dot(right)) + room, Math.abs(point.dot(up)) + room];
    const needed = Math.max(sideways / tangentRight, upwards / tangentUp);
    distance = Math.max(distance, needed + point.dot(towardsViewer));
  }
  return distance;
}
