// Where a ray first enters a surface of triangles. Every triangle is tried: some 10 000 take a tenth of a millisecond.

import type { Vec3 } from "../net/protocol";

/** What a ray meets: a triangle, the barycentric weights of its corners, and how far along the ray. */
export interface RayHit {
  triangle: number;
  weights: Vec3;
  distance: number;
}

/**
 * The first triangle that a ray meets from outside, by the cut of Möller and Trumbore (1997); null where there is none.
 *
 * positions (s, 3) and triangles (k, 3), counter-clockwise seen from outside; `skips` leaves points of triangles out. The
 * direction need not be of length one: distances are in its length.
 */
export function firstEntry(
  positions: Float32Array,
  triangles: Uint32Array,
  origin: Vec3,
  direction: Vec3,
  skips: (triangle: number, weights: Vec3) => boolean = () => false,
): RayHit | null {
  const [ox, oy, oz] = origin;
  const [dx, dy, dz] = direction;
  let best: RayHit | null = null;
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t]!;
    const b = 3 * triangles[t + 1]!;
    const c = 3 * triangles[t + 2]!;
    const [ax, ay, az] = [positions[a]!, positions[a + 1]!, positions[a + 2]!];
    const [ux, uy, uz] = [positions[b]! - ax, positions[b + 1]! - ay, positions[b + 2]! - az];
    const [vx, vy, vz] = [positions[c]! - ax, positions[c + 1]! - ay, positions[c + 2]! - az];
    const [px, py, pz] = [dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx];
    // Negative where the ray leaves the body, zero along the triangle.
    const determinant = ux * px + uy * py + uz * pz;
    if (determinant <= 0) continue;
    const [sx, sy, sz] = [ox - ax, oy - ay, oz - az];
    const second = sx * px + sy * py + sz * pz;
    if (second < 0 || second > determinant) continue;
    const [qx, qy, qz] = [sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux];
    const third = dx * qx + dy * qy + dz * qz;
    if (third < 0 || second + third > determinant) continue;
    const distance = (vx * qx + vy * qy + vz * qz) / determinant;
    if (distance < 0 || (best && distance >= best.distance)) continue;
    const [w1, w2] = [second / determinant, third / determinant];
    const weights: Vec3 = [1 - w1 - w2, w1, w2];
    if (!skips(t / 3, weights)) best = { triangle: t / 3, weights, distance };
  }
  return best;
}
