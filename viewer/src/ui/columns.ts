// Rows of numbers, stored by column. The first column is a time. When there is no more room, the older half is dropped.

export class Columns {
  private readonly columns: readonly Float64Array[];
  private rows = 0;

  constructor(
    width: number,
    private readonly rowsMax: number,
  ) {
    this.columns = Array.from({ length: width }, () => new Float64Array(rowsMax));
  }

  /** Appends the row of `values` that begins at `start`. */
  push(values: Float32Array, start: number): void {
    if (this.rows === this.rowsMax) {
      this.rows = this.rowsMax / 2;
      for (const column of this.columns) column.copyWithin(0, this.rowsMax - this.rows);
    }
    this.columns.forEach((column, k) => (column[this.rows] = values[start + k]!));
    this.rows += 1;
  }

  clear(): void {
    this.rows = 0;
  }

  /** Newest value of a column; 0 without rows. */
  newest(column: number): number {
    return this.columns[column]![this.rows - 1] ?? 0;
  }

  /** The first row from which on no time is before `time`. */
  firstSince(time: number): number {
    let first = this.rows;
    while (first > 0 && this.columns[0]![first - 1]! >= time) first -= 1;
    return first;
  }

  /** Values of a column, not copied. */
  part(column: number, first: number, end = this.rows): Float64Array {
    return this.columns[column]!.subarray(first, end);
  }
}
