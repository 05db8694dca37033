// Green strain in the plane of the faces of a surface, at its nodes: as `palpate.fields.surface_strain` computes it.

/** Derivatives along both edges of the shape functions of a flat triangle, anywhere. */
const FLAT: readonly (readonly [number, number])[][] = [
  [
    [-1, -1],
    [1, 0],
    [0, 1],
  ],
];

/** The same of a 6-node face at each of its nodes: corners, then the middles of edges 01, 12 and 20. */
const CURVED = ([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]] as const).map(([s, t]): [number, number][] => {
  const r = 1 - s - t;
  return [
    [1 - 4 * r, 1 - 4 * r],
    [4 * s - 1, 0],
    [0, 4 * t - 1],
    [4 * (r - s), -4 * s],
    [4 * t, 4 * s],
    [-4 * t, 4 * (r - t)],
  ];
});

export class SurfaceStrain {
  private readonly slopes: readonly (readonly (readonly [number, number])[])[];
  /** Of each place of each face, the inverse of its tangents at rest in its plane. */
  private readonly inverses: Float64Array;
  private readonly facesAround: Float64Array;
  private readonly values: Float32Array;

  constructor(
    private readonly positions: Float32Array,
    private readonly faces: Uint32Array,
    private readonly nodesPerFace: number,
  ) {
    this.slopes = nodesPerFace === 6 ? CURVED : FLAT;
    const count = faces.length / nodesPerFace;
    this.inverses = new Float64Array(3 * count * this.slopes.length);
    this.facesAround = new Float64Array(positions.length / 3);
    this.values = new Float32Array(positions.length / 3);
    for (const node of faces) this.facesAround[node]! += 1;
    const rest = new Float64Array(positions);
    for (let face = 0, at = 0; face < count; face++) {
      for (let place = 0; place < this.slopes.length; place++, at += 3) {
        const [a, b] = this.tangents(rest, face, place);
        const length = Math.hypot(...a);
        const along = dot(a, b) / length;
        const across = Math.hypot(...([0, 1, 2] as const).map((k) => b[k] - (along * a[k]) / length));
        this.inverses.set([1 / length, -along / (length * across), 1 / across], at);
      }
    }
  }

  /** Mean over the faces around each node of the largest principal strain in magnitude, for displacements (3 a node), m. */
  atNodes(displacements: Float64Array): Float32Array {
    const { positions, faces, nodesPerFace, slopes, inverses, values, facesAround } = this;
    const moved = displacements.map((u, i) => u + positions[i]!);
    values.fill(0);
    for (let face = 0, at = 0; face * nodesPerFace < faces.length; face++) {
      for (let place = 0; place < slopes.length; place++, at += 3) {
        const [first, second] = this.tangents(moved, face, place);
        const [a, b, c] = [inverses[at]!, inverses[at + 1]!, inverses[at + 2]!];
        const g1 = first.map((x) => a * x) as Triple;
        const g2 = first.map((x, k) => b * x + c * second[k]!) as Triple;
        const [xx, yy, xy] = [0.5 * (dot(g1, g1) - 1), 0.5 * (dot(g2, g2) - 1), 0.5 * dot(g1, g2)];
        const strain = Math.abs(0.5 * (xx + yy)) + Math.hypot(0.5 * (xx - yy), xy);
        if (slopes.length > 1) values[faces[face * nodesPerFace + place]!]! += strain;
        else for (let k = 0; k < 3; k++) values[faces[3 * face + k]!]! += strain;
      }
    }
    for (let node = 0; node < values.length; node++) values[node]! /= Math.max(facesAround[node]!, 1);
    return values;
  }

  private tangents(positions: Float64Array, face: number, place: number): [Triple, Triple] {
    const { faces, nodesPerFace } = this;
    const first: Triple = [0, 0, 0];
    const second: Triple = [0, 0, 0];
    const slopes = this.slopes[place]!;
    for (let k = 0; k < nodesPerFace; k++) {
      const node = 3 * faces[face * nodesPerFace + k]!;
      const [s, t] = slopes[k]!;
      for (let axis = 0; axis < 3; axis++) {
        first[axis]! += s * positions[node + axis]!;
        second[axis]! += t * positions[node + axis]!;
      }
    }
    return [first, second];
  }
}

type Triple = [number, number, number];

function dot(a: Triple, b: Triple): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
