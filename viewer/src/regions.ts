// Colours of the regions of bodies, and of materials, which several regions may share.

import type { RegionMessage, SceneMessage } from "./net/protocol";

/** Colours that are told apart with any colour vision (Okabe and Ito 2008); they come again after the last one. */
const PALETTE = ["#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7"];

/** What is drawn in one colour: a region of a body, or all regions of one material. */
export interface Group {
  color: string;
  body: number;
  /** The first region of the group. */
  region: RegionMessage;
}

export interface Grouping {
  groups: Group[];
  /** The group of each region of each body. */
  of: number[][];
}

/** Regions of all bodies of a scene, each by itself; or by material, from the softest on. */
export function grouped(scene: SceneMessage, by: "region" | "material"): Grouping {
  const all = scene.bodies.flatMap(({ regions }, body) => regions.map((region) => ({ body, region })));
  const keys = all.map(({ region }, i) => (by === "region" ? String(i) : materialKey(region)));
  const order = all.map((_, i) => i).filter((i) => keys.indexOf(keys[i]!) === i);
  if (by === "material") order.sort((a, b) => all[a]!.region.youngs_modulus - all[b]!.region.youngs_modulus);
  const groups = order.map((i, rank) => ({ ...all[i]!, color: PALETTE[rank % PALETTE.length]! }));
  const groupOf = new Map(order.map((i, rank) => [keys[i], rank]));
  const ranks = keys.map((key) => groupOf.get(key)!);
  return { groups, of: scene.bodies.map((_, body) => ranks.filter((_rank, i) => all[i]!.body === body)) };
}

/** The ways to colour regions that tell something: several of them, of several materials. */
export function groupings(scene: SceneMessage | null): ("region" | "material")[] {
  return (["region", "material"] as const).filter((by) => scene !== null && grouped(scene, by).groups.length > 1);
}

function materialKey({ youngs_modulus, poissons_ratio, density }: RegionMessage): string {
  return [youngs_modulus, poissons_ratio, density].join();
}
