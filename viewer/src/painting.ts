// Parts of a surface that a person paints to be computed next, and what is known of each node.

import { NODES_A_MESSAGE, maskOfNodes, nodesOfMask } from "./net/computed_messages";
import type { ComputedBody } from "./net/computed_messages";
import type { ClientMessage } from "./net/protocol";
import { inControl } from "./store";
import type { PaintTool, State, Store, Stroke } from "./store";

/** Pixels. */
export const BRUSH_MIN = 4;
export const BRUSH_MAX = 120;
const BRUSH_STEP = 1.25;

/** What a node of the surface is; of the nodes that a vertex stands for the largest is shown. */
export const READY = 0;
export const NOT_TOUCHABLE = 1;
export const NOT_READY = 2;
export const WAITING = 3;
export const PAINTED = 4;

/** Whether more of a body can be touched later. A region that was chosen once and is whole is no such body. */
function grows({ ready, done, columns }: ComputedBody): boolean {
  return ready !== null && done < columns;
}

/** Whether more of a scene can be touched later. */
export function isGrowing({ computed, exam }: Readonly<State>): boolean {
  return exam === null && (computed?.bodies.some(grows) ?? false);
}

/** What each surface node of a body is; null where no more can be touched later. */
export function touchStates({ computed, scene, strokes }: Readonly<State>, body: number): Uint8Array | null {
  const [columns, header] = [computed?.bodies[body], scene?.bodies[body]];
  if (!columns?.ready || !header || !grows(columns)) return null;
  const states = new Uint8Array(header.surface_nodes).fill(columns.region === null ? NOT_READY : NOT_TOUCHABLE);
  for (const node of columns.region === null ? [] : nodesOfMask(columns.region)) states[node] = NOT_READY;
  for (const node of columns.waiting === null ? [] : nodesOfMask(columns.waiting)) states[node] = WAITING;
  for (const stroke of strokes) for (const node of stroke[body] ?? []) if (states[node] === NOT_READY) states[node] = PAINTED;
  for (const node of nodesOfMask(columns.ready)) states[node] = READY;
  return states;
}

type StateCounts = [ready: number, never: number, later: number, waiting: number, painted: number];

/** How many surface nodes of all bodies are in each state. */
export function countStates(state: Readonly<State>): StateCounts {
  const counts: StateCounts = [0, 0, 0, 0, 0];
  state.scene?.bodies.forEach((header, body) => {
    const states = touchStates(state, body);
    if (!states) counts[READY] += header.surface_nodes;
    else for (const one of states) counts[one as 0 | 1 | 2 | 3 | 4] += 1;
  });
  return counts;
}

/** Whether strokes are the supports of a body that is set up. */
export function isPaintingSupports({ setup }: Readonly<State>): boolean {
  return setup?.editing === true && setup.body?.filled === true && setup.body.painted;
}

/** What each surface node of a body that is set up is: painted, or nothing. */
export function heldStates({ strokes, scene }: Readonly<State>): Uint8Array | null {
  const count = scene?.bodies[0]?.surface_nodes;
  if (!count) return null;
  const states = new Uint8Array(count);
  for (const node of paintedNodes(strokes, 0)) states[node] = PAINTED;
  return states;
}

/** Mask of all nodes of the first body that strokes have marked; null for none. */
export function heldMask(strokes: readonly Stroke[], count: number): string | null {
  const nodes = paintedNodes(strokes, 0);
  return nodes.size > 0 ? maskOfNodes(Array.from(nodes), count) : null;
}

/** Nodes of a body that strokes have marked. */
export function paintedNodes(strokes: readonly Stroke[], body: number): Set<number> {
  return new Set(strokes.flatMap((stroke) => Array.from(stroke[body] ?? [])));
}

/** Nodes of a surface by as many as a message takes: the first of those, their mask, and how many of them there are. */
function messages(nodes: ReadonlySet<number>, count: number): { first: number; mask: string; size: number }[] {
  return Array.from({ length: Math.ceil(count / NODES_A_MESSAGE) }, (_, i) => {
    const first = i * NODES_A_MESSAGE;
    const end = Math.min(first + NODES_A_MESSAGE, count);
    const here = Array.from(nodes).filter((node) => node >= first && node < end).map((node) => node - first);
    return { first, mask: maskOfNodes(here, end - first), size: here.length };
  });
}

export class Painting {
  constructor(private readonly store: Store, private readonly send: (message: ClientMessage) => void) {
    store.subscribe(["role", "connection", "computed", "exam", "setup"], (state) => {
      if (state.paintTool && !this.able(state)) store.update({ paintTool: null });
    });
  }

  /** A tool that is chosen again is put away. */
  choose(tool: PaintTool): void {
    const state = this.store.get();
    if (!this.able(state)) return;
    this.store.update({ paintTool: state.paintTool === tool ? null : tool });
  }

  leavePaintTool(): void {
    this.store.update({ paintTool: null });
  }

  setBrush(radius: number): void {
    this.store.update({ brushRadius: Math.min(Math.max(radius, BRUSH_MIN), BRUSH_MAX) });
  }

  /** A step larger, or smaller. */
  changeBrush(steps: number): void {
    this.setBrush(this.store.get().brushRadius * BRUSH_STEP ** steps);
  }

  /** Keeps what of a stroke is not ready and not asked for; one that marks nothing is none. */
  add(stroke: Stroke): void {
    const state = this.store.get();
    if (isPaintingSupports(state)) {
      if (stroke.some((nodes) => nodes.length > 0)) this.hold([...state.strokes, stroke]);
      return;
    }
    const painted = stroke.map((nodes, body) => {
      const states = touchStates(state, body);
      return states ? nodes.filter((node) => states[node] === NOT_READY) : new Uint32Array(0);
    });
    if (painted.some((nodes) => nodes.length > 0)) this.store.update({ strokes: [...state.strokes, painted] });
  }

  undo(): void {
    this.replace(this.store.get().strokes.slice(0, -1));
  }

  clear(): void {
    if (this.store.get().strokes.length > 0) this.replace([]);
  }

  private replace(strokes: readonly Stroke[]): void {
    if (isPaintingSupports(this.store.get())) this.hold(strokes);
    else this.store.update({ strokes });
  }

  /** Takes strokes for the supports of the body that is set up. */
  private hold(strokes: readonly Stroke[]): void {
    const { setup, scene } = this.store.get();
    const count = scene?.bodies[0]?.surface_nodes ?? 0;
    if (!setup?.body) return;
    this.store.update({ strokes, setup: { ...setup, body: { ...setup.body, held: heldMask(strokes, count), saved: null } } });
    for (const { first, mask } of messages(paintedNodes(strokes, 0), count)) this.send({ type: "hold", first, nodes: mask });
  }

  /** Asks for all that is painted. */
  compute(): void {
    const state = this.store.get();
    const { strokes, scene } = state;
    if (isPaintingSupports(state)) return this.leavePaintTool();
    if (!inControl(state) || !scene || strokes.length === 0) return;
    scene.bodies.forEach(({ surface_nodes }, body) => {
      for (const { first, mask, size } of messages(paintedNodes(strokes, body), surface_nodes)) {
        if (size > 0) this.send({ type: "paint", body, first, nodes: mask });
      }
    });
    this.store.update({ strokes: [], paintTool: null });
  }

  private able(state: Readonly<State>): boolean {
    return inControl(state) && (isGrowing(state) || isPaintingSupports(state));
  }
}
