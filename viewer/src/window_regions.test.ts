import { describe, expect, it } from "vitest";

import { withinLasso, withinStroke } from "./window_regions";
import type { Place } from "./window_regions";

describe("a stroke", () => {
  it("is what is within the radius of its way", () => {
    const within = withinStroke([10, 10], [30, 10], 5);
    const places: [Place, boolean][] = [[[20, 14.9], true], [[20, 15.1], false], [[34.9, 10], true], [[34, 14], false], [[5.1, 10], true]];
    for (const [place, expected] of places) expect(within(place)).toBe(expected);
  });

  it("of no length is a disc", () => {
    const within = withinStroke([10, 10], [10, 10], 5);
    expect([within([13, 13]), within([14, 14])]).toEqual([true, false]);
  });
});

describe("a lasso", () => {
  // An L, closed from its last corner to its first.
  const within = withinLasso([[0, 0], [30, 0], [30, 10], [10, 10], [10, 30], [0, 30]]);

  it("is what its line goes around", () => {
    const places: [Place, boolean][] = [[[5, 5], true], [[25, 5], true], [[5, 25], true], [[20, 20], false], [[-1, 5], false], [[5, 31], false]];
    for (const [place, expected] of places) expect(within(place)).toBe(expected);
  });

  it("without an area has nothing in it", () => {
    expect(withinLasso([[0, 0], [10, 0]])([5, 0.1])).toBe(false);
  });
});
