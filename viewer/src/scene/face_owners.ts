// Which tetrahedron each triangle of the surface belongs to.

import type { BodyArrays } from "../net/protocol";

/** Faces of a positively oriented tetrahedron, outward. */
const TET_FACES = [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2];

/** Tetrahedron of each triangle of the surface, as a row of `tets`. */
export function faceOwners({ nodes, tets, surface_triangles, surface_nodes }: BodyArrays): Uint32Array {
  const count = nodes.length / 3;
  const onSurface = new Uint8Array(count);
  for (const node of surface_nodes) onSurface[node] = 1;
  // Triangles by their two lowest nodes: a product of three numbers of nodes may be too large for an exact key.
  const byEdge = new Map<number, { third: number; triangle: number }[]>();
  const sorted = (a: number, b: number, c: number) => [a, b, c].sort((p, q) => p - q) as [number, number, number];
  for (let i = 0; i < surface_triangles.length / 3; i++) {
    const [low, middle, third] = sorted(...corners(surface_triangles, 3 * i, 0, 1, 2));
    const key = low * count + middle;
    const others = byEdge.get(key);
    if (others) others.push({ third, triangle: i });
    else byEdge.set(key, [{ third, triangle: i }]);
  }
  const owners = new Uint32Array(surface_triangles.length / 3);
  for (let tet = 0; tet < tets.length / 4; tet++) {
    for (let f = 0; f < TET_FACES.length; f += 3) {
      const face = corners(tets, 4 * tet, TET_FACES[f]!, TET_FACES[f + 1]!, TET_FACES[f + 2]!);
      if (!face.every((node) => onSurface[node] === 1)) continue;
      const [low, middle, third] = sorted(...face);
      const found = byEdge.get(low * count + middle)?.find((entry) => entry.third === third);
      if (found) owners[found.triangle] = tet;
    }
  }
  return owners;
}

function corners(from: Uint32Array, start: number, a: number, b: number, c: number): [number, number, number] {
  return [from[start + a]!, from[start + b]!, from[start + c]!];
}
