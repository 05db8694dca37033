// The last seconds of the 1 kHz log, in arrays that the plots can take as they are.

/** Length of the plots, s. */
export const WINDOW_S = 10;
/** Room for an unthinned log, twice, so that old rows are dropped in one move now and then. */
const ROWS_MAX = 2 * WINDOW_S * 1000;

export class LogWindow {
  private readonly time = new Float64Array(ROWS_MAX);
  private readonly force = new Float64Array(ROWS_MAX);
  private readonly compute = new Float64Array(ROWS_MAX);
  private count = 0;

  /** Takes rows of time s, force N, computing time us. */
  append(rows: Float32Array): void {
    for (let i = 0; i < rows.length; i += 3) {
      const time = rows[i]!;
      // A new loop starts at zero: nothing before it belongs to the same time.
      if (this.count > 0 && time < this.time[this.count - 1]! - 0.5) this.count = 0;
      if (this.count === ROWS_MAX) this.dropOld();
      this.time[this.count] = time;
      this.force[this.count] = rows[i + 1]!;
      this.compute[this.count] = rows[i + 2]!;
      this.count += 1;
    }
  }

  clear(): void {
    this.count = 0;
  }

  get now(): number {
    return this.count > 0 ? this.time[this.count - 1]! : 0;
  }

  /** Time relative to now, force, and computing time, in the window. */
  read(): { time: Float64Array; force: Float64Array; compute: Float64Array } {
    const now = this.now;
    let first = this.count;
    while (first > 0 && this.time[first - 1]! >= now - WINDOW_S) first -= 1;
    return {
      time: this.time.slice(first, this.count).map((time) => time - now),
      force: this.force.subarray(first, this.count),
      compute: this.compute.subarray(first, this.count),
    };
  }

  private dropOld(): void {
    const remaining = ROWS_MAX / 2;
    for (const column of [this.time, this.force, this.compute]) column.copyWithin(0, ROWS_MAX - remaining);
    this.count = remaining;
  }
}
