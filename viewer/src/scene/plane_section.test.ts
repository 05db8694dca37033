import { describe, expect, it } from "vitest";

import type { Vec3 } from "../net/protocol";
import { planeSection } from "./plane_section";
import type { PlaneSection } from "./plane_section";

/** A unit cube of five tetrahedra, positively oriented; the middle one is of another region. */
const CUBE = {
  nodes: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1]),
  tets: new Uint32Array([1, 2, 4, 7, 0, 1, 2, 4, 3, 2, 1, 7, 5, 4, 7, 1, 6, 4, 2, 7]),
  tet_regions: new Uint32Array([1, 0, 0, 0, 0]),
};

function positions({ ends, shares }: PlaneSection, nodes = CUBE.nodes): Vec3[] {
  return Array.from(shares, (share, i) => {
    const [a, b] = [3 * ends[2 * i]!, 3 * ends[2 * i + 1]!];
    return [0, 1, 2].map((k) => nodes[a + k]! + share * (nodes[b + k]! - nodes[a + k]!)) as Vec3;
  });
}

/** Sum of the vector areas of the triangles, of one region or of all. */
function vectorArea(section: PlaneSection, region: number | null = null): Vec3 {
  const places = positions(section);
  const sum: Vec3 = [0, 0, 0];
  for (let t = 0; t < section.triangles.length; t += 3) {
    const corners = Array.from(section.triangles.subarray(t, t + 3));
    if (region !== null && section.regions[corners[0]!] !== region) continue;
    const [p, q, r] = corners.map((corner) => places[corner]!) as [Vec3, Vec3, Vec3];
    const [u, v] = [q.map((x, k) => x - p[k]!), r.map((x, k) => x - p[k]!)] as [Vec3, Vec3];
    for (let k = 0; k < 3; k++) {
      const [i, j] = [(k + 1) % 3, (k + 2) % 3];
      sum[k]! += (u[i]! * v[j]! - u[j]! * v[i]!) / 2;
    }
  }
  return sum;
}

describe("the section of a cube", () => {
  it.each<[Vec3, number, number]>([
    [[0, 0, 1], 0.3, 1],
    [[0, 0, -1], -0.3, 1],
    [[1, 0, 0], 0.75, 1],
    // A regular hexagon through the middle of the cube, and a triangle near a corner.
    [[1 / Math.sqrt(3), 1 / Math.sqrt(3), 1 / Math.sqrt(3)], Math.sqrt(3) / 2, (3 * Math.sqrt(3)) / 4],
    [[1 / Math.sqrt(3), 1 / Math.sqrt(3), 1 / Math.sqrt(3)], 0.1 * Math.sqrt(3), (Math.sqrt(3) / 2) * 0.3 ** 2],
    // Through nodes: what is beyond it is cut at its faces, each once.
    [[0, 0, 1], 0, 1],
  ])("by the plane %j . x = %d has the area %d, and faces what is taken away", (normal, offset, area) => {
    const section = planeSection(CUBE, normal, offset);
    for (const [x, y, z] of positions(section)) {
      expect(x * normal[0] + y * normal[1] + z * normal[2]).toBeCloseTo(offset, 6);
    }
    vectorArea(section).forEach((component, k) => expect(component).toBeCloseTo(area * normal[k]!, 5));
  });

  it.each<[Vec3, number]>([
    [[0, 0, 1], 1],
    [[0, 0, 1], 1.5],
    [[0, 0, 1], -0.5],
  ])("by a plane beside it is empty: %j . x = %d", (normal, offset) => {
    expect(planeSection(CUBE, normal, offset).triangles.length).toBe(0);
  });

  it("has every triangle in one region, and each region's share of the area", () => {
    const section = planeSection(CUBE, [0, 0, 1], 0.5);
    for (let t = 0; t < section.triangles.length; t += 3) {
      const regions = [...section.triangles.subarray(t, t + 3)].map((corner) => section.regions[corner]);
      expect(new Set(regions).size).toBe(1);
    }
    // The middle tetrahedron's section is the square between the middles of four of its edges.
    expect(vectorArea(section, 1)[2]).toBeCloseTo(0.5, 6);
    expect(vectorArea(section, 0)[2]).toBeCloseTo(0.5, 6);
  });

  it("shares corners between neighbours of a region", () => {
    const one = planeSection({ ...CUBE, tet_regions: new Uint32Array(5) }, [0, 0, 1], 0.3);
    const places = new Set(positions(one).map((place) => place.map((x) => x.toFixed(6)).join()));
    expect(places.size).toBe(one.shares.length);
  });

  it("follows the nodes", () => {
    const sheared = CUBE.nodes.map((x, i) => (i % 3 === 0 ? x + 0.5 * CUBE.nodes[i + 2]! : x));
    for (const [, , z] of positions(planeSection(CUBE, [0, 0, 1], 0.25), sheared)) expect(z).toBeCloseTo(0.25, 6);
  });
});
