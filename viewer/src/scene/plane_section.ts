// Where a plane cuts tetrahedra, as one flat polygon for each (marching tetrahedra): a triangle where it leaves one corner
// to a side, a quadrilateral where it leaves two. Corners lie on edges, so that they follow the nodes as the body deforms.

import type { BodyArrays, Vec3 } from "../net/protocol";

/** The section as triangles, whose normals at rest are that of the plane. */
export interface PlaneSection {
  /** Nodes (v, 2) at the ends of the edge that each corner lies on, and the share of the second one. */
  ends: Uint32Array;
  shares: Float32Array;
  /** Region of the tetrahedra that share a corner; at a boundary each side has its own. */
  regions: Float32Array;
  /** Corners (k, 3). */
  triangles: Uint32Array;
}

type Edge = readonly [number, number];

/**
 * Edges of a positively oriented tetrahedron that are cut, around the polygon as it is seen from beyond the plane, by which
 * corners are beyond it: bit i for corner i.
 */
const CUTS: readonly (readonly Edge[] | null)[] = cuts();

function cuts(): (readonly Edge[] | null)[] {
  const found: (readonly Edge[] | null)[] = new Array<null>(16).fill(null);
  // Even orders of the corners, so that each is oriented as the element: one corner alone, or two.
  for (const [a, b, c, d] of [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]] as const) {
    found[1 << a] = [[a, b], [a, d], [a, c]];
    found[15 ^ (1 << a)] = [[a, b], [a, c], [a, d]];
  }
  for (const [a, b, c, d] of [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]] as const) {
    found[(1 << a) | (1 << b)] = [[a, c], [b, c], [b, d], [a, d]];
  }
  return found;
}

/** The section by the plane normal . x = offset, through the positions at rest. */
export function planeSection(arrays: Pick<BodyArrays, "nodes" | "tets" | "tet_regions">, normal: Vec3, offset: number): PlaneSection {
  const { nodes, tets, tet_regions } = arrays;
  const heights = new Float64Array(nodes.length / 3);
  for (let i = 0; i < heights.length; i++) {
    heights[i] = normal[0] * nodes[3 * i]! + normal[1] * nodes[3 * i + 1]! + normal[2] * nodes[3 * i + 2]! - offset;
  }
  const corners = new Corners(heights);
  const triangles: number[] = [];
  for (let t = 0; t < tets.length; t += 4) {
    let beyond = 0;
    for (let i = 0; i < 4; i++) if (heights[tets[t + i]!]! > 0) beyond |= 1 << i;
    const cut = CUTS[beyond];
    if (!cut) continue;
    const place = ([a, b]: Edge) => corners.between(tets[t + a]!, tets[t + b]!, tet_regions[t / 4]!);
    const [first, ...others] = cut.map(place) as [number, ...number[]];
    for (let k = 1; k < others.length; k++) triangles.push(first, others[k - 1]!, others[k]!);
  }
  return { ...corners.arrays(), triangles: new Uint32Array(triangles) };
}

/** Corners of the section, each once for every region. */
class Corners {
  private readonly known = new Map<number, Map<number, number>>();
  private readonly ends: number[] = [];
  private readonly shares: number[] = [];
  private readonly regions: number[] = [];

  constructor(private readonly heights: Float64Array) {}

  /** The corner on the edge between a node of one side and one of the other. */
  between(one: number, other: number, region: number): number {
    const [a, b] = one < other ? [one, other] : [other, one];
    const ofRegion = this.known.get(region) ?? new Map<number, number>();
    this.known.set(region, ofRegion);
    const key = a * this.heights.length + b;
    const found = ofRegion.get(key);
    if (found !== undefined) return found;
    const [low, high] = [this.heights[a]!, this.heights[b]!];
    this.ends.push(a, b);
    this.shares.push(low / (low - high));
    this.regions.push(region);
    ofRegion.set(key, this.shares.length - 1);
    return this.shares.length - 1;
  }

  arrays(): Omit<PlaneSection, "triangles"> {
    return {
      ends: new Uint32Array(this.ends),
      shares: new Float32Array(this.shares),
      regions: new Float32Array(this.regions),
    };
  }
}
