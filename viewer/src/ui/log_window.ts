// The last seconds of the 1 kHz log, in arrays that the plots can take as they are.

import { Columns } from "./columns";

/** Length of the plots, s. */
export const WINDOW_S = 10;
/** Room for an unthinned log, twice, so that old rows are dropped in one move now and then. */
const ROWS_MAX = 2 * WINDOW_S * 1000;

export class LogWindow {
  private readonly columns = new Columns(3, ROWS_MAX);

  /** Takes rows of time s, force N, computing time us. */
  append(rows: Float32Array): void {
    for (let i = 0; i < rows.length; i += 3) {
      // A new loop starts at zero: nothing before it belongs to the same time.
      if (rows[i]! < this.now - 0.5) this.clear();
      this.columns.push(rows, i);
    }
  }

  clear(): void {
    this.columns.clear();
  }

  get now(): number {
    return this.columns.newest(0);
  }

  /** Time relative to now, force, and computing time, in the window. */
  read(): { time: Float64Array; force: Float64Array; compute: Float64Array } {
    const now = this.now;
    const first = this.columns.firstSince(now - WINDOW_S);
    return {
      time: this.columns.part(0, first).map((time) => time - now),
      force: this.columns.part(1, first),
      compute: this.columns.part(2, first),
    };
  }
}
