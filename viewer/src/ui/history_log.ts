// The last seconds of a body's motion, in its own time: displacement of the watched node, and where the energy is.

import type { Vec3 } from "../net/protocol";
import { Columns } from "./columns";

/** Numbers in a row of a frame's history. */
const COLUMNS = 8;
/** Room for twice the longest span of the plots, a step of the body every millisecond. */
const ROWS_MAX = 20_000;

/** Columns as a plot takes them. Times in s relative to `origin`, displacements in mm, energies in J. */
export interface History {
  time: Float64Array;
  displacement: [Float64Array, Float64Array, Float64Array];
  kinetic: Float64Array;
  strain: Float64Array;
  total: Float64Array;
  /** What the body would hold without damping: what it held at the left edge, and the work since. */
  supplied: Float64Array;
}

export class HistoryLog {
  private readonly columns = new Columns(COLUMNS, ROWS_MAX);

  append(rows: Float32Array): void {
    for (let i = 0; i + COLUMNS <= rows.length; i += COLUMNS) this.columns.push(rows, i);
  }

  clear(): void {
    this.columns.clear();
  }

  /** The `span` seconds after `origin`, or those before now if there is none. */
  read(span: number, origin: number | null): History {
    const now = this.columns.newest(0);
    const start = origin ?? now - span;
    const first = this.columns.firstSince(start);
    const time = this.columns.part(0, first);
    let end = first;
    while (end - first < time.length && time[end - first]! <= start + span) end += 1;
    const part = (k: number) => this.columns.part(k, first, end);
    const millimetres = (k: number) => part(k).map((metres) => 1000 * metres);
    const [total, work] = [part(6), part(7)];
    return {
      time: part(0).map((t) => t - (origin ?? now)),
      displacement: [millimetres(1), millimetres(2), millimetres(3)],
      kinetic: part(4),
      strain: part(5),
      total,
      supplied: work.map((w) => total[0]! + w - work[0]!),
    };
  }

  /** The newest row: body time s, displacement m, energies J. */
  latest(): { bodyTime: number; displacement: Vec3; kinetic: number; strain: number; total: number; work: number } {
    const [bodyTime, x, y, z, kinetic, strain, total, work] = Array.from({ length: COLUMNS }, (_, k) =>
      this.columns.newest(k),
    );
    return {
      bodyTime: bodyTime!,
      displacement: [x!, y!, z!],
      kinetic: kinetic!,
      strain: strain!,
      total: total!,
      work: work!,
    };
  }
}
