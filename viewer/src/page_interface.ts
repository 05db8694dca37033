// `window.palpate`: what programs may do with the page, and state and points on the screen for browser tests.

import * as THREE from "three";

import type { Pointer } from "./input/pointer";
import type { RecordingStatus, ReplayFrame } from "./net/session_messages";
import type { Carrier } from "./net/carrier";
import type { FieldMessage, FrameMessage, MotionFrame, ToolFrame, Vec3 } from "./net/protocol";
import { paintedNodes } from "./painting";
import type { BodyView } from "./scene/body_view";
import type { Stage } from "./scene/stage";
import { drivenTool } from "./store";
import type { Store } from "./store";
import type { HistoryLog } from "./ui/history_log";
import type { Statistics } from "./ui/statistics";

/** How many of the best candidates are tried before giving up. */
const CANDIDATES = 200;

export interface ViewerState {
  connected: boolean;
  role: string;
  scene: string | null;
  /** Of the driven tool. */
  shape: string | null;
  force: Vec3;
  forceMagnitude: number;
  limited: boolean;
  depth: number | null;
  tools: ToolFrame[];
  pinned: readonly number[];
  contacts: number;
  frames: number;
  frameNumber: number;
  framesPerSecond: number;
  /** Spent on moving what is drawn, for all frames so far, ms. */
  tookMs: number;
  pointerEvents: number;
  ticks: number;
  strain: number;
  /** Of the body that is chosen. */
  field: FieldMessage | null;
  fault: string | null;
  /** Where an exam stands, whether the next body is awaited, and how loud its tone is. */
  exam: { trial: number; finished: boolean; answering: boolean; loudness: number } | null;
  /** Of a body that is set up: whether it has its tetrahedra, how many nodes are painted, and the middle of its nodule. */
  filled: boolean;
  held: number;
  nodule: Vec3 | null;
  recording: RecordingStatus | null;
  replay: ReplayFrame | null;
  /** Of a body in motion, with the newest row of its history. */
  motion: (MotionFrame & ReturnType<HistoryLog["latest"]>) | null;
}

declare global {
  interface Window {
    palpate: {
      /** When the first frame is drawn. */
      ready: Promise<void>;
      /** Sends a tool to a place, m; null takes it out of the scene. */
      move(position: Vec3 | null, tool?: number): void;
      /** The newest tick that is drawn; null before the first. */
      frame(): FrameMessage | null;
      /** Forces on the first device, N, at each of its positions (three numbers each, m), from rest and tick by tick. */
      run(positions: Float64Array): Promise<Float64Array>;
      state(): ViewerState;
      project(point: Vec3): [number, number];
      /** Unit vector towards the viewer, and the distance from what is looked at, m. */
      view(): { towards: Vec3; distance: number; target: Vec3 };
      pickPoint(body?: number): [number, number] | null;
    };
  }
}

export interface Parts {
  store: Store;
  stage: Stage;
  pointer: Pointer;
  statistics: Statistics;
  history: HistoryLog;
  carrier: Carrier;
}

export function installPageInterface(parts: Parts): void {
  const { stage, store, carrier } = parts;
  let arrived = () => {};
  const ready = new Promise<void>((resolve) => (arrived = resolve));
  store.subscribe(["frame"], ({ frame }) => {
    if (frame) arrived();
  });
  window.palpate = {
    ready,
    move: (position, tool = 0) => {
      if (position) carrier.send({ type: "press", tool, position, grab: false });
      else carrier.send({ type: "release", tool });
    },
    frame: () => store.get().frame,
    run: (positions) => carrier.run(positions),
    state: () => viewerState(parts),
    project: (point) => stage.viewport.project(new THREE.Vector3(...point)),
    view: () => {
      const { camera, controls } = stage.viewport;
      return {
        towards: stage.viewport.towardsViewer().toArray(),
        distance: camera.position.distanceTo(controls.target),
        target: controls.target.toArray(),
      };
    },
    pickPoint: (body = 0) => {
      const view = stage.bodies[body];
      return view ? pickPoint(stage, view, body) : null;
    },
  };
}

function viewerState({ store, pointer, statistics, history }: Parts): ViewerState {
  const state = store.get();
  const { frame, scene } = state;
  const driven = frame?.tools[drivenTool(state) ?? 0];
  const force = driven?.force ?? [0, 0, 0];
  return {
    connected: state.connection === "open",
    role: state.role,
    scene: scene?.name ?? null,
    shape: scene?.tools[drivenTool(state) ?? 0]?.shape ?? null,
    force,
    forceMagnitude: Math.hypot(...force),
    limited: driven?.limited ?? false,
    depth: pointer.wantedDepth,
    tools: frame?.tools ?? [],
    pinned: state.pinned,
    contacts: frame?.contacts.length ?? 0,
    frames: statistics.frames,
    frameNumber: frame?.frame ?? 0,
    framesPerSecond: statistics.framesPerSecond,
    tookMs: statistics.tookMs,
    pointerEvents: pointer.events,
    ticks: frame?.ticks ?? 0,
    strain: frame?.strain ?? 0,
    field: frame?.fields[state.body] ?? null,
    fault: frame?.fault ?? null,
    filled: state.setup?.body?.filled ?? false,
    held: paintedNodes(state.strokes, 0).size,
    nodule: state.setup?.body?.nodule?.center ?? null,
    recording: frame?.recording ?? null,
    replay: frame?.replay ?? null,
    exam: state.exam && {
      trial: state.exam.trial,
      finished: state.exam.result !== null,
      answering: state.answering,
      loudness: frame?.loudness ?? 0,
    },
    motion: frame?.motion ? { ...frame.motion, ...history.latest() } : null,
  };
}

/** Client coordinates of a point near the middle of the visible top of a body that no control covers. */
function pickPoint(stage: Stage, { surface, placed, bounds }: BodyView, body: number): [number, number] | null {
  const { viewport } = stage;
  const centre = bounds.getCenter(new THREE.Vector3());
  const size = bounds.getSize(new THREE.Vector3()).length();
  const place = (i: number) => new THREE.Vector3().fromArray(surface.shown, 3 * i).applyMatrix4(placed.matrix);
  const score = (i: number) => {
    const { x, y, z } = place(i).sub(centre);
    const normal = new THREE.Vector3().fromArray(surface.shownNormals, 3 * i).applyQuaternion(placed.quaternion);
    // Higher and flatter is better, further from the middle is worse.
    return z / size + 0.5 * normal.z - 2 * (Math.hypot(x, y) / size);
  };
  const ranked = Array.from({ length: surface.count }, (_, i) => [score(i), i] as const).sort((a, b) => b[0] - a[0]);
  for (const [, i] of ranked.slice(0, CANDIDATES)) {
    const point = place(i);
    // A mouse reports whole pixels: beside a cut the next one may be on the other side.
    const [x, y] = viewport.project(point).map(Math.round) as [number, number];
    if (document.elementFromPoint(x, y) !== viewport.canvas) continue;
    const pick = stage.pick(viewport.rayThrough(x, y));
    if (pick?.body === body && pick.shown.distanceTo(point) < 0.03 * size) return [x, y];
  }
  return null;
}
