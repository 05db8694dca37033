// The touchable surface: positions of its nodes at rest, untouched, deformed and as drawn, and values at any point of it.

import type { BodyArrays, Vec3 } from "../net/protocol";

/** A point that stays with its triangle: barycentric weights of the three corners. */
export interface SurfacePoint {
  corners: [number, number, number];
  weights: Vec3;
}

export class Surface {
  /** Rest positions (s, 3), m. */
  readonly rest: Float32Array;
  /** Deformed positions (s, 3), m. */
  readonly positions: Float32Array;
  /** Where they are drawn (s, 3), m: displacements may be shown larger than they are; and unit normals of that shape. */
  readonly shown: Float32Array;
  readonly shownNormals: Float32Array;
  /** Positions and normals while no tool touches: where the body's own loads have put it. */
  readonly untouched: Float32Array;
  readonly untouchedNormals: Float32Array;
  /** Positions and normals of the body at rest under its own loads. */
  readonly settled: Float32Array;
  private readonly settledNormals: Float32Array;
  /** Corners of the triangles (k, 3) as rows of the arrays above. */
  readonly triangles: Uint32Array;
  readonly count: number;
  /** Of a triangle at rest, m, doubled: no edge is ever stretched beyond it. */
  readonly longestEdge: number;

  constructor(arrays: BodyArrays) {
    this.count = arrays.surface_nodes.length;
    const rankOfNode = new Uint32Array(arrays.nodes.length / 3);
    this.rest = new Float32Array(3 * this.count);
    arrays.surface_nodes.forEach((node, rank) => {
      rankOfNode[node] = rank;
      this.rest.set(arrays.nodes.subarray(3 * node, 3 * node + 3), 3 * rank);
    });
    this.triangles = arrays.surface_triangles.map((node) => rankOfNode[node]!);
    this.longestEdge = 2 * longestEdge(this.rest, this.triangles);
    this.positions = this.rest.slice();
    this.shown = this.rest.slice();
    this.shownNormals = new Float32Array(3 * this.count);
    vertexNormals(this.rest, this.triangles, this.shownNormals);
    this.settled = this.rest.map((x, i) => x + arrays.free[i]!);
    this.settledNormals = new Float32Array(3 * this.count);
    vertexNormals(this.settled, this.triangles, this.settledNormals);
    this.untouched = this.settled.slice();
    this.untouchedNormals = this.settledNormals.slice();
  }

  /**
   * Displaces the surface, and draws the displacements times a scale; rowOf gives the row of a surface node in the
   * displacements.
   */
  displace(displacements: Float32Array, rowOf: Uint32Array | null, scale: number): void {
    const { positions, shown, rest } = this;
    for (let i = 0; i < this.count; i++) {
      const row = 3 * (rowOf ? rowOf[i]! : i);
      for (let axis = 0; axis < 3; axis++) {
        const [at, moved] = [3 * i + axis, displacements[row + axis]!];
        positions[at] = rest[at]! + moved;
        shown[at] = rest[at]! + scale * moved;
      }
    }
    vertexNormals(shown, this.triangles, this.shownNormals);
  }

  /** Takes the shape now for that of the untouched body. */
  storeAsUntouched(): void {
    this.untouched.set(this.positions);
    vertexNormals(this.untouched, this.triangles, this.untouchedNormals);
  }

  /** Takes the body at rest for the untouched one. */
  settle(): void {
    this.untouched.set(this.settled);
    this.untouchedNormals.set(this.settledNormals);
  }

  /** Interpolates one of the arrays above. */
  at(values: Float32Array, point: SurfacePoint): Vec3 {
    const result: Vec3 = [0, 0, 0];
    for (let corner = 0; corner < 3; corner++) {
      const row = 3 * point.corners[corner]!;
      for (let axis = 0; axis < 3; axis++) result[axis]! += point.weights[corner]! * values[row + axis]!;
    }
    return result;
  }

  /** Where the untouched surface is drawn (s, 3), m. */
  untouchedAsShown(scale: number): Float32Array {
    return this.untouched.map((x, i) => this.rest[i]! + scale * (x - this.rest[i]!));
  }

  /**
   * A point of the untouched surface and the unit normal there, both continuous across the edges of triangles.
   *
   * A flat triangle lies below a curved surface. The tangent planes of its corners lie above it by twice as much, where
   * the surface is one of second order: half of their mean distance is taken (Phong tessellation, Boubekeur and Alexa
   * 2008, with the factor 1/2).
   */
  smoothPoint(point: SurfacePoint): { place: Vec3; normal: Vec3 } {
    const { untouched, untouchedNormals } = this;
    const flat = this.at(untouched, point);
    const place: Vec3 = [...flat];
    point.corners.forEach((corner, k) => {
      const row = 3 * corner;
      let above = 0;
      for (let axis = 0; axis < 3; axis++) above += (untouched[row + axis]! - flat[axis]!) * untouchedNormals[row + axis]!;
      const share = 0.5 * point.weights[k]! * above;
      for (let axis = 0; axis < 3; axis++) place[axis]! += share * untouchedNormals[row + axis]!;
    });
    const [x, y, z] = this.at(untouchedNormals, point);
    const length = Math.hypot(x, y, z) || 1;
    return { place, normal: [x / length, y / length, z / length] };
  }

  cornersOf(triangle: number): [number, number, number] {
    const t = this.triangles;
    return [t[3 * triangle]!, t[3 * triangle + 1]!, t[3 * triangle + 2]!];
  }
}

/**
 * Unit normals of the nodes: each triangle's cross product over the squares of the two edges at the corner (Max 1999),
 * exact where the nodes lie on a sphere. Weights by area are off by degrees where triangles differ in shape.
 */
export function vertexNormals(positions: Float32Array, triangles: Uint32Array, normals: Float32Array): void {
  normals.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t]!;
    const b = 3 * triangles[t + 1]!;
    const c = 3 * triangles[t + 2]!;
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    const ab = ux * ux + uy * uy + uz * uz;
    const ac = vx * vx + vy * vy + vz * vz;
    const bc = (vx - ux) ** 2 + (vy - uy) ** 2 + (vz - uz) ** 2;
    addScaled(normals, a, nx, ny, nz, ab * ac);
    addScaled(normals, b, nx, ny, nz, ab * bc);
    addScaled(normals, c, nx, ny, nz, ac * bc);
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i]!, normals[i + 1]!, normals[i + 2]!) || 1;
    normals[i]! /= length;
    normals[i + 1]! /= length;
    normals[i + 2]! /= length;
  }
}

function longestEdge(positions: Float32Array, triangles: Uint32Array): number {
  let longest = 0;
  for (let t = 0; t < triangles.length; t++) {
    const a = 3 * triangles[t]!;
    const b = 3 * triangles[t % 3 === 2 ? t - 2 : t + 1]!;
    const length = Math.hypot(
      positions[b]! - positions[a]!,
      positions[b + 1]! - positions[a + 1]!,
      positions[b + 2]! - positions[a + 2]!,
    );
    longest = Math.max(longest, length);
  }
  return longest;
}

/** A triangle without area adds nothing. */
function addScaled(normals: Float32Array, at: number, x: number, y: number, z: number, over: number): void {
  if (over === 0) return;
  normals[at]! += x / over;
  normals[at + 1]! += y / over;
  normals[at + 2]! += z / over;
}

/** Sides of the box around points (n, 3). */
export function sidesOf(points: Float32Array): Vec3 {
  const low: Vec3 = [Infinity, Infinity, Infinity];
  const high: Vec3 = [-Infinity, -Infinity, -Infinity];
  points.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3]!, value);
    high[i % 3] = Math.max(high[i % 3]!, value);
  });
  return [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
}
