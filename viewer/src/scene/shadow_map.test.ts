import { describe, expect, it } from "vitest";

import { shadowOf } from "./shadow_map";

/** A level square plate with sides of 1 m around the origin, at a height, and a speck on the ground far away. */
function plate(height: number): ReturnType<typeof shadowOf> {
  const square = [-0.5, -0.5, height, 0.5, -0.5, height, 0.5, 0.5, height, -0.5, 0.5, height];
  const speck = [0.45, 0.45, 0, 0.46, 0.45, 0, 0.45, 0.46, 0];
  return shadowOf(new Float32Array([...square, ...speck]), new Uint32Array([0, 1, 2, 0, 2, 3, 4, 5, 6]));
}

function at({ darkness, width, left, bottom }: ReturnType<typeof shadowOf>, x: number, y: number): number {
  const texels = Math.sqrt(darkness.length);
  const [column, row] = [Math.floor(((x - left) / width) * texels), Math.floor(((y - bottom) / width) * texels)];
  return darkness[row * texels + column]!;
}

describe("the shadow on the ground", () => {
  it("is dark below a body, soft at its edge, and gone at the end of the picture", () => {
    const shadow = plate(0.01);
    expect(shadow.ground).toBe(0);
    expect(at(shadow, 0, 0)).toBeGreaterThan(0.7);
    const edge = [0.4, 0.5, 0.6].map((x) => at(shadow, x, 0));
    expect(edge[0]! > edge[1]! && edge[1]! > edge[2]!).toBe(true);
    for (let i = 0; i < 96; i++) expect(shadow.darkness[i]!).toBeLessThan(0.02);
  });

  it("is fainter below a body that stands higher", () => {
    expect(at(plate(0.5), 0, 0)).toBeLessThan(0.75 * at(plate(0.01), 0, 0));
  });

  it("lies where the body does", () => {
    const points = new Float32Array([2, 5, 1, 3, 5, 1, 2, 6, 1]);
    const shadow = shadowOf(points, new Uint32Array([0, 1, 2]));
    expect(shadow.ground).toBe(1);
    expect(at(shadow, 2.25, 5.25)).toBeGreaterThan(3 * at(shadow, 2.9, 5.9));
  });
});
