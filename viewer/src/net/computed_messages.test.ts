import { describe, expect, it } from "vitest";

import { maskOfNodes, nodesOfMask } from "./computed_messages";

describe("masks of nodes", () => {
  it("are the bytes that numpy.packbits makes with bitorder little", () => {
    // np.packbits(mask of 0, 3, 8, 17 in 20 nodes, bitorder="little") is [9, 1, 2].
    expect(maskOfNodes([0, 3, 8, 17], 20)).toBe(btoa("\x09\x01\x02"));
  });

  it("give their nodes back", () => {
    const nodes = Array.from({ length: 16384 }, (_, k) => k).filter((k) => k % 7 === 2);
    const mask = maskOfNodes(nodes, 16384);
    expect(mask.length).toBeLessThan(3000);
    expect([...nodesOfMask(mask)]).toEqual(nodes);
  });
});
