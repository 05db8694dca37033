// The state of the page: the server's last messages, and the user's choices. Parts of the page read it, change it by
// `update`, and subscribe to keys.

import type { ConnectionState } from "./net/carrier";
import type { ComputedMessage } from "./net/computed_messages";
import type { SetupMessage } from "./net/setup_messages";
import type { RecordedMessage } from "./net/session_messages";
import type {
  Choice,
  ExamMessage,
  FrameMessage,
  Role,
  SceneMessage,
  SettingsMessage,
  StatusMessage,
  Vec3,
} from "./net/protocol";

export type Axis = "x" | "y" | "z";
export type Layer = "colors" | "wireframe" | "supports" | "cutaway" | "plots";
/** What the bodies are coloured by: tissue with the colours of strain where there is strain, a field, regions, materials. */
export type Coloring = "strained" | "field" | "region" | "material";
export type Theme = "dark" | "light";
export type Tab = "motion" | "force" | "loop" | "modes";
/** What the pointer marks nodes of the surface by. */
export type PaintTool = "brush" | "lasso";
/** Nodes of the surface of each body that one stroke has marked. */
export type Stroke = readonly Uint32Array[];
/** Displacements may be drawn so many times as large as they are. */
export const SHOWN_SCALE_MAX = 10;
/** A cut takes away this share of the extent at first. */
export const CUT_SHARE = 0.5;

/** The tool that the pointer drives, with the depth of a press or the length of a pull that the pointer wants, m. */
export interface Pressing {
  tool: number;
  grab: boolean;
  depth: number;
}

/** How a tool is held on the surface that it touches, degrees: how far it leans from upright, and where to. */
export interface Posture {
  tilt: number;
  turn: number;
}

export interface State {
  connection: ConnectionState;
  role: Role;
  /** Of the program. */
  version: string;
  models: Choice[];
  status: StatusMessage | null;
  scene: SceneMessage | null;
  /** Sides of the box around each body at rest, in its own frame, m. */
  sizes: readonly Vec3[];
  settings: SettingsMessage | null;
  /** The newest one that is drawn. */
  frame: FrameMessage | null;
  notices: readonly string[];
  /** The recording that ended last, until it is dismissed. */
  recorded: RecordedMessage | null;
  /** How far the columns of the bodies are; null before the server has told. */
  computed: ComputedMessage | null;
  /** The body that is set up in the page, and what files may be brought; null before the server has told. */
  setup: SetupMessage | null;
  /** null where nothing is examined. */
  exam: ExamMessage | null;
  /** Whether an answer is on its way: the next body is not there yet. */
  answering: boolean;

  layers: Readonly<Record<Layer, boolean>>;
  /** The axis across which the body is cut open, and the share of its extent that is taken away. */
  cut: Readonly<{ axis: Axis; share: number }>;
  /** Displacements are drawn so many times. */
  shownScale: number;
  /** Name of the field in colours; null until one is chosen. */
  field: string | null;
  coloring: Coloring;
  /** Whether the controls behind More are shown. */
  more: boolean;
  /** Where the colours of a field end, in its unit, by its name; a field that is not here follows its largest value. */
  ranges: Readonly<Record<string, number>>;
  theme: Theme;
  /** The body that stiffness and legend belong to. */
  body: number;
  tab: Tab;

  /** What the pointer paints with; null where it presses. Radius of the brush, pixels. */
  paintTool: PaintTool | null;
  brushRadius: number;
  /** What is painted and not asked for yet. */
  strokes: readonly Stroke[];

  /** Whether a press holds on to the surface; whether a click strikes; the impulse of a strike, N s. */
  grab: boolean;
  strike: boolean;
  impulse: number;
  pressing: Readonly<Pressing> | null;
  /** Of each tool. */
  postures: readonly Readonly<Posture>[];
  /** Tools that stay where they were left. */
  pinned: readonly number[];
  /** Whether the next press stays where it is let go. */
  pinNext: boolean;
}

/** What is shown in an exam: nothing that an eye could read it from. */
export const NO_LAYERS: Readonly<Record<Layer, boolean>> = {
  colors: false,
  wireframe: false,
  supports: false,
  cutaway: false,
  plots: false,
};

export function initialState(): State {
  return {
    connection: "connecting",
    role: "watch",
    version: "",
    models: [],
    status: null,
    scene: null,
    sizes: [],
    settings: null,
    frame: null,
    notices: [],
    recorded: null,
    computed: null,
    setup: null,
    exam: null,
    answering: false,
    layers: { colors: true, wireframe: false, supports: false, cutaway: false, plots: true },
    cut: { axis: "y", share: CUT_SHARE },
    shownScale: 1,
    field: null,
    coloring: "strained",
    more: false,
    ranges: {},
    theme: "dark",
    body: 0,
    tab: "force",
    paintTool: null,
    brushRadius: 24,
    strokes: [],
    grab: false,
    strike: false,
    impulse: 0,
    pressing: null,
    postures: [],
    pinned: [],
    pinNext: false,
  };
}

type Listener = (state: Readonly<State>) => void;

export class Store {
  private state = initialState();
  private readonly listeners = new Map<keyof State, Set<Listener>>();

  get(): Readonly<State> {
    return this.state;
  }

  /** Takes over what differs; listeners hear of it before this returns, each once. */
  update(change: Partial<State>): void {
    const changed = (Object.keys(change) as (keyof State)[]).filter((key) => change[key] !== this.state[key]);
    if (changed.length === 0) return;
    this.state = { ...this.state, ...change };
    const concerned = new Set(changed.flatMap((key) => [...(this.listeners.get(key) ?? [])]));
    // A listener may change the state itself: each gets it as it is by then.
    for (const listener of concerned) listener(this.state);
  }

  /** Calls a listener now and after every change of one of the keys. */
  subscribe(keys: readonly (keyof State)[], listener: Listener): void {
    for (const key of keys) {
      const listeners = this.listeners.get(key) ?? new Set();
      this.listeners.set(key, listeners.add(listener));
    }
    listener(this.state);
  }
}

/** Whether this page may touch the body. */
export function inControl({ role, connection }: Readonly<State>): boolean {
  return role === "control" && connection === "open";
}

/** The tool that is driven, or that the next press drives; null where all are pinned, or moved by devices. */
export function drivenTool({ scene, pressing, pinned }: Readonly<State>): number | null {
  if (pressing) return pressing.tool;
  const free = (scene?.tools ?? []).findIndex(({ device }, tool) => device === null && !pinned.includes(tool));
  return free < 0 ? null : free;
}

/** The tool whose numbers are shown: the one that the pointer drives, else the first that a device moves. */
export function shownTool(state: Readonly<State>): number | null {
  if (state.pressing) return state.pressing.tool;
  const moved = (state.scene?.tools ?? []).findIndex(({ device }) => device !== null);
  return moved < 0 ? drivenTool(state) : moved;
}
