import { describe, expect, it } from "vitest";

import type { SceneMessage } from "./net/protocol";
import { grouped, groupings } from "./regions";

const region = (title: string, youngs_modulus: number) => ({ title, youngs_modulus, poissons_ratio: 0.45, density: 1000 });
const scene = {
  bodies: [
    { regions: [region("Rest", 2e4), region("Nodule", 8e4), region("Capsule", 2e4)] },
    { regions: [] },
    { regions: [region("Pad", 1e4)] },
  ],
} as unknown as SceneMessage;

describe("regions", () => {
  it("each have a colour, over all bodies", () => {
    const { groups, of } = grouped(scene, "region");
    expect(groups.map(({ region: { title } }) => title)).toEqual(["Rest", "Nodule", "Capsule", "Pad"]);
    expect(new Set(groups.map(({ color }) => color)).size).toBe(4);
    expect(of).toEqual([[0, 1, 2], [], [3]]);
  });

  it("of one material share it, the softest first", () => {
    const { groups, of } = grouped(scene, "material");
    expect(groups.map((group) => group.region.youngs_modulus)).toEqual([1e4, 2e4, 8e4]);
    expect(of).toEqual([[1, 2, 1], [], [0]]);
  });

  it("are told apart only where there are several", () => {
    const of = (...moduli: number[]) => ({ bodies: [{ regions: moduli.map((e, i) => region(String(i), e)) }] }) as unknown as SceneMessage;
    expect(groupings(of(1e4, 2e4))).toEqual(["region", "material"]);
    expect(groupings(of(1e4, 1e4))).toEqual(["region"]);
    expect(groupings(of(1e4))).toEqual([]);
    expect(groupings(of())).toEqual([]);
    expect(groupings(null)).toEqual([]);
  });
});
