// The place of the untouched surface that is closest to a point. Every triangle is tried, most of them by a corner alone.

import * as THREE from "three";

import type { Vec3 } from "../net/protocol";
import type { Surface, SurfacePoint } from "./surface";

export function closestSurfacePoint(surface: Surface, point: Vec3): SurfacePoint {
  const { untouched, triangles, longestEdge } = surface;
  const [x, y, z] = point;
  const target = new THREE.Vector3(...point);
  const triangle = new THREE.Triangle();
  const closest = new THREE.Vector3();
  const found = new THREE.Vector3();
  let best = 0;
  let bestDistance = Infinity;
  for (let t = 0; t < triangles.length; t += 3) {
    // No point of a triangle is nearer than a corner less the longest edge.
    const a = 3 * triangles[t]!;
    const corner = Math.hypot(untouched[a]! - x, untouched[a + 1]! - y, untouched[a + 2]! - z);
    if (corner - longestEdge > bestDistance) continue;
    load(triangle, surface, t / 3);
    triangle.closestPointToPoint(target, closest);
    const distance = closest.distanceTo(target);
    if (distance < bestDistance) {
      best = t / 3;
      bestDistance = distance;
      found.copy(closest);
    }
  }
  const weights = load(triangle, surface, best).getBarycoord(found, new THREE.Vector3());
  // A triangle without area has no barycentric coordinates: its first corner stands for it.
  return { corners: surface.cornersOf(best), weights: weights ? weights.toArray() : [1, 0, 0] };
}

function load(triangle: THREE.Triangle, surface: Surface, index: number): THREE.Triangle {
  const [a, b, c] = surface.cornersOf(index);
  triangle.a.fromArray(surface.untouched, 3 * a);
  triangle.b.fromArray(surface.untouched, 3 * b);
  triangle.c.fromArray(surface.untouched, 3 * c);
  return triangle;
}
