// What a body looks like in a frame: displacements of the vertices that are drawn, and a field in colours.

import type { AnyArray, FieldMessage } from "../net/protocol";
import { SurfaceStrain } from "./surface_strain";

/** A range spans at least this part of the body's size, and as a strain this. */
const LEAST = 0.005;
/** A range grows at once and comes down with this time constant, s. */
const DECAY = 0.8;

/** Fields that a page without a server computes. */
export type FieldName = "displacement" | "strain";
const FIELDS: Record<FieldName, Pick<FieldMessage, "name" | "title" | "unit">> = {
  displacement: { name: "displacement", title: "Displacement", unit: "mm" },
  strain: { name: "strain", title: "Strain in the surface", unit: "%" },
};

export interface Picture {
  field: FieldMessage;
  displacements: Float32Array;
  scalar: Uint8Array;
  interior: boolean;
  /** Largest strain in the surface. */
  strain: number;
}

export class BodyPicture {
  private readonly strain: SurfaceStrain;
  /** Surface rows of the vertices that are drawn. */
  private readonly drawn: Uint32Array;
  /** Nodes of the surface and inside of the whole body; of each inner node the surface rows it follows, and how much. */
  private readonly surfaceNodes: Uint32Array;
  private readonly inner: { nodes: Uint32Array; rows: Uint32Array; weights: Float32Array };
  private readonly ranges = new Map<FieldName, [number, number]>();

  constructor(arrays: Map<string, AnyArray>, body: number, nodesPerFace: number, private readonly size: number) {
    const array = (name: string) => arrays.get(`${body}/${name}`)!;
    this.strain = new SurfaceStrain(array("positions") as Float32Array, array("faces") as Uint32Array, nodesPerFace);
    this.drawn = array("drawn") as Uint32Array;
    this.surfaceNodes = array("surface_nodes") as Uint32Array;
    this.inner = {
      nodes: array("inner_nodes") as Uint32Array,
      rows: array("inner_rows") as Uint32Array,
      weights: array("inner_weights") as Float32Array,
    };
  }

  picture(displacements: Float64Array, name: FieldName, max: number | null, cutaway: boolean, nowMs: number): Picture {
    const strains = this.strain.atNodes(displacements);
    const values = name === "strain" ? strains.map((value) => 100 * value) : lengths(displacements);
    const largest = values.reduce((most, value) => Math.max(most, value), 0);
    const end = max !== null ? Math.max(max, 1e-9) : this.range(name, largest, nowMs);
    const inside = cutaway && this.inner.nodes.length > 0;
    const [rows, shown] = inside ? this.everywhere(displacements, values) : [pick(displacements, this.drawn, 3), pick(values, this.drawn, 1)];
    const scalar = Uint8Array.from(shown, (value) => Math.round(255 * Math.min(Math.max(value / end, 0), 1)));
    const field = { ...FIELDS[name], signed: false, gaps: false, min: 0, max: end, largest };
    return { field, displacements: rows, scalar, interior: inside, strain: strains.reduce((most, s) => Math.max(most, s), 0) };
  }

  private range(name: FieldName, largest: number, nowMs: number): number {
    const least = name === "strain" ? 100 * LEAST : 1e3 * LEAST * this.size;
    const [before, then] = this.ranges.get(name) ?? [0, nowMs];
    const decayed = largest + (before - largest) * Math.exp((then - nowMs) / (1e3 * DECAY));
    const end = Math.max(largest, decayed, least);
    this.ranges.set(name, [end, nowMs]);
    return end;
  }

  /** All nodes of the body: those inside follow the surface nodes around them. */
  private everywhere(displacements: Float64Array, values: Float32Array): [Float32Array, Float32Array] {
    const { nodes, rows, weights } = this.inner;
    const count = this.surfaceNodes.length + nodes.length;
    const each = rows.length / nodes.length;
    const moved = new Float32Array(3 * count);
    const scalar = new Float32Array(count);
    this.surfaceNodes.forEach((node, row) => {
      for (let k = 0; k < 3; k++) moved[3 * node + k] = displacements[3 * row + k]!;
      scalar[node] = values[row]!;
    });
    nodes.forEach((node, rank) => {
      for (let i = rank * each; i < (rank + 1) * each; i++) {
        const [row, weight] = [rows[i]!, weights[i]!];
        for (let k = 0; k < 3; k++) moved[3 * node + k]! += weight * displacements[3 * row + k]!;
        scalar[node]! += weight * values[row]!;
      }
    });
    return [moved, scalar];
  }
}

export function isComputed(name: string): name is FieldName {
  return Object.hasOwn(FIELDS, name);
}

function lengths(displacements: Float64Array): Float32Array {
  const found = new Float32Array(displacements.length / 3);
  for (let i = 0; i < found.length; i++) {
    found[i] = 1e3 * Math.hypot(displacements[3 * i]!, displacements[3 * i + 1]!, displacements[3 * i + 2]!);
  }
  return found;
}

function pick(values: ArrayLike<number>, rows: Uint32Array, each: number): Float32Array {
  const picked = new Float32Array(each * rows.length);
  rows.forEach((row, i) => {
    for (let k = 0; k < each; k++) picked[each * i + k] = values[each * row + k]!;
  });
  return picked;
}
