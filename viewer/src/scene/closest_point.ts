// The place of the untouched surface that is closest to a point. Every triangle is tried: it runs once for each contact.

import * as THREE from "three";

import type { Vec3 } from "../net/protocol";
import type { Surface, SurfacePoint } from "./surface";

export function closestSurfacePoint(surface: Surface, point: Vec3): SurfacePoint {
  const target = new THREE.Vector3(...point);
  const triangle = new THREE.Triangle();
  const closest = new THREE.Vector3();
  const found = new THREE.Vector3();
  let best = 0;
  let bestDistance = Infinity;
  for (let i = 0; i < surface.triangles.length / 3; i++) {
    load(triangle, surface, i);
    triangle.closestPointToPoint(target, closest);
    const distance = closest.distanceToSquared(target);
    if (distance < bestDistance) {
      best = i;
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
