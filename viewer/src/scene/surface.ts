// The touchable surface: positions of its nodes at rest, untouched and deformed, and values at any point of it.

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
  /** Unit normals of the deformed surface (s, 3). */
  readonly normals: Float32Array;
  /** Positions and normals while no tool touches: where the body's own loads have put it. */
  readonly untouched: Float32Array;
  readonly untouchedNormals: Float32Array;
  /** Positions and normals of the body at rest under its own loads. */
  readonly settled: Float32Array;
  private readonly settledNormals: Float32Array;
  /** Corners of the triangles (k, 3) as rows of the arrays above. */
  readonly triangles: Uint32Array;
  readonly count: number;

  constructor(arrays: BodyArrays) {
    this.count = arrays.surface_nodes.length;
    const rankOfNode = new Uint32Array(arrays.nodes.length / 3);
    this.rest = new Float32Array(3 * this.count);
    arrays.surface_nodes.forEach((node, rank) => {
      rankOfNode[node] = rank;
      this.rest.set(arrays.nodes.subarray(3 * node, 3 * node + 3), 3 * rank);
    });
    this.triangles = arrays.surface_triangles.map((node) => rankOfNode[node]!);
    this.positions = this.rest.slice();
    this.normals = new Float32Array(3 * this.count);
    vertexNormals(this.rest, this.triangles, this.normals);
    this.settled = this.rest.map((x, i) => x + arrays.free[i]!);
    this.settledNormals = new Float32Array(3 * this.count);
    vertexNormals(this.settled, this.triangles, this.settledNormals);
    this.untouched = this.settled.slice();
    this.untouchedNormals = this.settledNormals.slice();
  }

  /** Displaces the surface; rowOf gives the row of a surface node in the displacements. */
  displace(displacements: Float32Array, rowOf: Uint32Array | null): void {
    const { positions, rest } = this;
    for (let i = 0; i < this.count; i++) {
      const row = 3 * (rowOf ? rowOf[i]! : i);
      positions[3 * i] = rest[3 * i]! + displacements[row]!;
      positions[3 * i + 1] = rest[3 * i + 1]! + displacements[row + 1]!;
      positions[3 * i + 2] = rest[3 * i + 2]! + displacements[row + 2]!;
    }
    vertexNormals(positions, this.triangles, this.normals);
  }

  /** Takes the shape now for that of the untouched body. */
  keepAsUntouched(): void {
    this.untouched.set(this.positions);
    this.untouchedNormals.set(this.normals);
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

  cornersOf(triangle: number): [number, number, number] {
    const t = this.triangles;
    return [t[3 * triangle]!, t[3 * triangle + 1]!, t[3 * triangle + 2]!];
  }
}

/** Normals of the nodes, each triangle weighted by its area: its cross product, not normalised, does just that. */
function vertexNormals(positions: Float32Array, triangles: Uint32Array, normals: Float32Array): void {
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
    for (const corner of [a, b, c]) {
      normals[corner]! += nx;
      normals[corner + 1]! += ny;
      normals[corner + 2]! += nz;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i]!, normals[i + 1]!, normals[i + 2]!) || 1;
    normals[i]! /= length;
    normals[i + 1]! /= length;
    normals[i + 2]! /= length;
  }
}
