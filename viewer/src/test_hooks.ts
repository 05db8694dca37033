// `window.palpate`: what a browser test needs to know, and where on the screen it may press.

import * as THREE from "three";

import type { BodyView } from "./body_view";
import type { HistoryLog } from "./history_log";
import type { FieldMessage, MotionFrame, Vec3 } from "./protocol";
import type { Viewport } from "./viewport";

/** How many of the best candidates are tried before giving up. */
const CANDIDATES = 200;

export interface ViewerState {
  connected: boolean;
  role: string;
  scene: string | null;
  force: Vec3;
  forceMagnitude: number;
  contacts: number;
  frames: number;
  frameNumber: number;
  framesPerSecond: number;
  pointerEvents: number;
  ticks: number;
  toolPosition: Vec3 | null;
  depth: number | null;
  strain: number;
  /** Whether the tool is held back from where the pointer is. */
  held: boolean;
  field: FieldMessage | null;
  fault: string | null;
  /** Of a body in motion, with the newest row of its history. */
  motion: (MotionFrame & ReturnType<HistoryLog["latest"]>) | null;
}

declare global {
  interface Window {
    palpate: {
      state(): ViewerState;
      project(point: Vec3): [number, number];
      pickPoint(): [number, number] | null;
    };
  }
}

export function installTestHooks(viewport: Viewport, body: () => BodyView | null, state: () => ViewerState): void {
  window.palpate = {
    state,
    project: (point) => viewport.project(new THREE.Vector3(...point)),
    pickPoint: () => {
      const view = body();
      return view ? pickPoint(viewport, view) : null;
    },
  };
}

/** Client coordinates of a point near the middle of the visible top that no control covers. */
function pickPoint(viewport: Viewport, view: BodyView): [number, number] | null {
  const { positions, normals, count } = view.surface;
  const centre = view.bounds.getCenter(new THREE.Vector3());
  const size = view.data.header.size;
  const point = new THREE.Vector3();
  const score = (i: number) => {
    point.fromArray(positions, 3 * i).sub(centre);
    // Higher and flatter is better, further from the middle is worse.
    return point.z / size + 0.5 * normals[3 * i + 2]! - 2 * (Math.hypot(point.x, point.y) / size);
  };
  const ranked = Array.from({ length: count }, (_, i) => [score(i), i] as const).sort((a, b) => b[0] - a[0]);
  for (const [, i] of ranked.slice(0, CANDIDATES)) {
    point.fromArray(positions, 3 * i);
    // A mouse reports whole pixels: beside a cut the next one may be on the other side.
    const [x, y] = viewport.project(point).map(Math.round) as [number, number];
    if (document.elementFromPoint(x, y) !== viewport.canvas) continue;
    const pick = view.pick(viewport.rayThrough(x, y));
    if (pick && pick.shown.distanceTo(point) < 0.03 * size) return [x, y];
  }
  return null;
}
