import { describe, expect, it } from "vitest";

import goldenFrame from "../../../tests/data/golden_frame.bin?inline";
import { PoseReader } from "./poses";
import type { CodedArrays } from "./poses";
import { decodeBinary, isScene } from "./protocol";

const NONE = new Uint8Array(0);
const STEP = 2 ** -20;

function whole(steps: number[], scalar: number[]): CodedArrays {
  return { moved: NONE, steps: Int16Array.from(steps), colored: NONE, scalar: Uint8Array.from(scalar) };
}

/** Nine rows, as the golden frame's first body has them. */
const first = whole(Array.from({ length: 27 }, (_, i) => i), [0, 1, 2, 3, 4, 5, 6, 7, 8]);

describe("poses", () => {
  it("that are whole are steps times their length", () => {
    const [pose] = new PoseReader().read(1, [{ rows: 2, step: STEP, base: null }], [whole([0, 1, -2, 32767, -32768, 5], [7, 255])])!;
    expect(Array.from(pose!.displacements)).toEqual([0, 1, -2, 32767, -32768, 5].map((count) => count * STEP));
    expect([...pose!.scalar]).toEqual([7, 255]);
  });

  it("that differ are added to the frame before: the golden frame, which Python writes", async () => {
    const data = decodeBinary(await (await fetch(goldenFrame)).arrayBuffer());
    if (isScene(data)) throw new Error("not a frame");
    const reader = new PoseReader();
    const before = { rows: 4, step: 1, base: null };
    reader.read(4710, [{ rows: 9, step: STEP, base: null }, before], [first, whole(new Array<number>(12).fill(0), [0, 0, 0, 0])]);
    const [left, right] = reader.read(data.header.frame, data.header.poses, data.bodies)!;
    // Rows 1, 4 and 8 move, row 7 is coloured anew.
    const expected = Array.from({ length: 27 }, (_, i) => i);
    [[1, 0, -1, 127], [4, -128, 5, 0], [8, 1, 2, 3]].forEach(([row, ...by]) => by.forEach((d, axis) => (expected[3 * row! + axis]! += d)));
    const step = data.header.poses[0]!.step;
    expect(Array.from(left!.displacements)).toEqual(expected.map((count) => Math.fround(count * step)));
    expect([...left!.scalar]).toEqual([0, 1, 2, 3, 4, 5, 6, 254, 8]);
    expect(Array.from(right!.displacements).slice(3, 6)).toEqual([32767, -32767, 1].map((count) => count * data.header.poses[1]!.step));
  });

  it("wrap as the differences did", () => {
    const reader = new PoseReader();
    reader.read(1, [{ rows: 1, step: 1, base: null }], [whole([30000, -30000, 0], [0])]);
    const coded = { moved: Uint8Array.of(1), steps: Int16Array.of(5536, -5536, 0), colored: Uint8Array.of(0), scalar: NONE };
    expect(Array.from(reader.read(2, [{ rows: 1, step: 1, base: 1 }], [coded])![0]!.displacements)).toEqual([-30000, 30000, 0]);
  });

  it.each<[string, number | null, Partial<CodedArrays>]>([
    ["to a frame that never came", 7, {}],
    ["with more steps than its mask has rows", 1, { steps: new Int8Array(6) }],
    ["with fewer colours than its mask has rows", 1, { colored: Uint8Array.of(3) }],
    ["whole, of too few rows", null, {}],
  ])("are refused: a difference %s", (_what, base, change) => {
    const reader = new PoseReader();
    reader.read(1, [{ rows: 9, step: STEP, base: null }], [first]);
    const coded = { moved: Uint8Array.of(1, 0), steps: new Int8Array(3), colored: Uint8Array.of(1, 0), scalar: new Uint8Array(1), ...change };
    expect(reader.read(2, [{ rows: 9, step: STEP, base }], [coded])).toBeNull();
    // What follows is not known either, until it is whole again.
    expect(reader.read(3, [{ rows: 9, step: STEP, base: 1 }], [{ ...coded, steps: new Int8Array(3) }])).toBeNull();
  });
});
