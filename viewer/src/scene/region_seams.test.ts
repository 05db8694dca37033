import { describe, expect, it } from "vitest";

import { splitAtSeams } from "./region_seams";

describe("seams between regions", () => {
  // A strip of four triangles over six nodes; the last two are of another region.
  const strip = new Uint32Array([0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4]);

  it("split only the nodes on them", () => {
    const { rows, regions, triangles } = splitAtSeams(strip, new Uint32Array([0, 0, 1, 1]), 6);
    expect([...rows]).toEqual([0, 1, 2, 3, 4, 5, 2, 3]);
    expect(Array.from(triangles, (vertex) => rows[vertex])).toEqual([...strip]);
    for (let t = 0; t < 4; t++) {
      const corners = [...triangles.subarray(3 * t, 3 * t + 3)];
      expect(corners.map((vertex) => regions[vertex])).toEqual([0, 1, 2].map(() => (t < 2 ? 0 : 1)));
    }
  });

  it("are not there in a body of one region", () => {
    const { rows, triangles } = splitAtSeams(strip, new Uint32Array(strip.length / 3), 6);
    expect(rows.length).toBe(6);
    expect([...triangles]).toEqual([...strip]);
  });
});
