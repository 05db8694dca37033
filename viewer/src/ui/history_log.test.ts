import { describe, expect, it } from "vitest";

import { HistoryLog } from "./history_log";

/** Rows from body time `from` (ms) on, one a millisecond: displacement (t, 2 t, 3 t) m, energies 4 t, 5 t, 9 t, work 12 t. */
function rows(from: number, count: number): Float32Array {
  const values = Array.from({ length: count }, (_, i) => (from + i) / 1000).flatMap((t) =>
    [1, 1, 2, 3, 4, 5, 9, 12].map((factor) => factor * t),
  );
  return new Float32Array(values);
}

describe("the history of a motion", () => {
  it("is empty at first", () => {
    const log = new HistoryLog();
    expect(log.read(1, null).time).toHaveLength(0);
    expect(log.latest()).toMatchObject({ bodyTime: 0, displacement: [0, 0, 0], work: 0 });
  });

  it("shows the time before now, displacements in mm", () => {
    const log = new HistoryLog();
    log.append(rows(0, 1000));
    const { time, displacement, kinetic, strain, total } = log.read(0.25, null);
    expect(time).toHaveLength(251);
    expect(time[0]).toBeCloseTo(-0.25, 6);
    expect(time.at(-1)).toBe(0);
    expect(displacement.map((column) => column.at(-1)! / 999)).toEqual([1, 2, 3].map((x) => expect.closeTo(x, 5) as number));
    expect([kinetic, strain, total].map((column) => column.at(-1)! / 0.999)).toEqual(
      [4, 5, 9].map((x) => expect.closeTo(x, 5) as number),
    );
  });

  it("shows the time after an origin, up to its span", () => {
    const log = new HistoryLog();
    log.append(rows(0, 1000));
    const { time } = log.read(0.1005, 0.5);
    expect(time[0]).toBeCloseTo(0, 6);
    expect(time.at(-1)).toBeCloseTo(0.1, 6);
    expect(time).toHaveLength(101);
  });

  it("supplies what the body held at the left edge, and the work since", () => {
    const log = new HistoryLog();
    log.append(rows(0, 1000));
    const { supplied, total } = log.read(0.1005, 0.5);
    expect(supplied[0]).toBe(total[0]);
    // 12 J/s of work, 9 of which stay in the body.
    expect(supplied.at(-1)! - supplied[0]!).toBeCloseTo(1.2, 5);
  });

  it("drops the oldest rows when it is full, and keeps the order", () => {
    const log = new HistoryLog();
    for (let from = 0; from < 30_000; from += 500) log.append(rows(from, 500));
    const { time } = log.read(9.5, null);
    expect(time).toHaveLength(9501);
    expect(time.every((t, i) => i === 0 || t > time[i - 1]!)).toBe(true);
    expect(log.latest().bodyTime).toBeCloseTo(29.999, 5);
  });

  it("leaves out a row that is not whole", () => {
    const log = new HistoryLog();
    log.append(rows(0, 3).subarray(0, 20));
    expect(log.read(1, null).time).toHaveLength(2);
  });

  it("forgets", () => {
    const log = new HistoryLog();
    log.append(rows(0, 3));
    log.clear();
    expect(log.read(1, null).time).toHaveLength(0);
  });
});
