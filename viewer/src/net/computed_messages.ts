// Messages about columns and series that are still computed, and about regions painted to be computed next.

/** How far the columns of every body are, in their order: sent when a page opens, and when it changes. */
export interface ComputedMessage {
  type: "computed";
  bodies: ComputedBody[];
  /** How far the series beyond small strain are; null while nothing is computed of them. */
  series: ComputedSeries | null;
}

export interface ComputedSeries {
  /** Places done, and in all; none while the places are chosen. */
  done: number;
  places: number;
  /** Until all are done; null while that is not known. */
  left_s: number | null;
  /** Why nothing is computed any more though places are missing; else null. */
  stopped: string | null;
}

export interface ComputedBody {
  /** Surface nodes that can be touched by now, as a mask of nodes (`nodesOfMask`); null for all of them. */
  ready: string | null;
  /** Those that can be touched once all columns are done, likewise. */
  region: string | null;
  /** Painted ones that wait to be computed; null for none. */
  waiting: string | null;
  /** Columns done, and in all. */
  done: number;
  columns: number;
  /** Until all are done; null while that is not known, or nothing is computed. */
  left_s: number | null;
  /** Why nothing is computed any more though columns are missing; else null. */
  stopped: string | null;
}

/**
 * Surface nodes that are to be computed next, as a mask whose bit 0 is the surface node `first`, a multiple of 8. What is
 * painted before its stage begins is joined: a large surface is sent in messages of at most `NODES_A_MESSAGE` nodes.
 */
export interface PaintMessage {
  type: "paint";
  body: number;
  first: number;
  nodes: string;
}

export const NODES_A_MESSAGE = 16384;

/** Bytes of a mask of `count` nodes in base64: bit `k % 8` of byte `k / 8`, the lowest first, is node k. */
export function maskOfNodes(nodes: Iterable<number>, count: number): string {
  const bytes = new Uint8Array(Math.ceil(count / 8));
  for (const node of nodes) bytes[node >> 3] = (bytes[node >> 3] ?? 0) | (1 << (node & 7));
  return btoa(String.fromCharCode(...bytes));
}

/** The nodes of a mask, ascending. */
export function nodesOfMask(mask: string): Uint32Array {
  const nodes: number[] = [];
  const bytes = atob(mask);
  for (let byte = 0; byte < bytes.length; byte++) {
    const bits = bytes.charCodeAt(byte);
    for (let bit = 0; bit < 8; bit++) if (bits & (1 << bit)) nodes.push(8 * byte + bit);
  }
  return Uint32Array.from(nodes);
}
