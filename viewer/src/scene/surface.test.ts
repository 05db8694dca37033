import * as THREE from "three";
import { describe, expect, it } from "vitest";

import type { BodyArrays, Vec3 } from "../net/protocol";
import { closestSurfacePoint } from "./closest_point";
import { arrowLength } from "./force_arrow";
import { firstEntry } from "./ray_surface";
import { Surface, sidesOf } from "./surface";

/** A ball of triangles whose corners lie on the sphere of 50 mm. */
const BALL = 0.05;
const ball = ballOf(12);

function ballOf(parts: number): { positions: Float32Array; triangles: Uint32Array } {
  const geometry = new THREE.IcosahedronGeometry(BALL, parts);
  const places = geometry.getAttribute("position");
  const nodes = new Map<string, number>();
  const positions: number[] = [];
  const triangles = Array.from({ length: places.count }, (_, i) => {
    const place = new THREE.Vector3().fromBufferAttribute(places, i);
    const key = place.toArray().map((x) => Math.round(1e7 * x)).join();
    if (!nodes.has(key)) positions.push(...place.toArray());
    return nodes.get(key) ?? (nodes.set(key, nodes.size), nodes.size - 1);
  });
  return { positions: new Float32Array(positions), triangles: new Uint32Array(triangles) };
}

function surfaceOf({ positions, triangles }: typeof ball): Surface {
  const count = positions.length / 3;
  return new Surface({
    nodes: positions,
    surface_triangles: triangles,
    surface_nodes: Uint32Array.from({ length: count }, (_, i) => i),
    free: new Float32Array(3 * count),
  } as unknown as BodyArrays);
}

describe("a ray", () => {
  const mesh = new THREE.Mesh(
    new THREE.BufferGeometry()
      .setAttribute("position", new THREE.BufferAttribute(ball.positions, 3))
      .setIndex(new THREE.BufferAttribute(ball.triangles, 1)),
  );

  it("meets what three's own raycaster meets", () => {
    let hits = 0;
    for (let i = 0; i < 60; i++) {
      const origin: Vec3 = [0.11 * Math.sin(i), 0.3 * Math.cos(2.3 * i), 0.2 * Math.sin(1.7 * i)];
      const towards = new THREE.Vector3(0.05 * Math.sin(5 * i), 0.05 * Math.cos(3 * i), 0.03 * Math.sin(7 * i));
      const direction = towards.sub(new THREE.Vector3(...origin)).normalize();
      const expected = new THREE.Raycaster(new THREE.Vector3(...origin), direction).intersectObject(mesh)[0];
      const found = firstEntry(ball.positions, ball.triangles, origin, direction.toArray());
      expect(found === null).toBe(expected === undefined);
      if (!found || !expected) continue;
      hits += 1;
      expect(found.triangle).toBe(expected.faceIndex);
      expect(found.distance).toBeCloseTo(expected.distance, 6);
      found.weights.forEach((weight, k) => expect(weight).toBeCloseTo(expected.barycoord!.toArray()[k]!, 4));
    }
    expect(hits).toBeGreaterThan(20);
  });

  it("does not meet the surface from inside, nor behind it, nor what it skips", () => {
    const { positions, triangles } = ball;
    expect(firstEntry(positions, triangles, [0, 0, 0], [0.3, 0.1, 1])).toBeNull();
    expect(firstEntry(positions, triangles, [0, 0, 0.2], [0.003, 0.001, 1])).toBeNull();
    const whole = firstEntry(positions, triangles, [0, 0, 0.2], [0.003, 0.001, -1]);
    expect(whole).not.toBeNull();
    expect(firstEntry(positions, triangles, [0, 0, 0.2], [0.003, 0.001, -1], (t) => t === whole!.triangle)).toBeNull();
  });
});

describe("displacements that are drawn larger than they are", () => {
  it("move what is drawn, and leave where the surface is", () => {
    const surface = surfaceOf(ball);
    const moved = surface.rest.map((x, i) => (i % 3 === 2 ? 0.02 * x : 0));
    surface.displace(moved, null, 5);
    const row = 3 * 7;
    expect(surface.positions[row + 2]).toBeCloseTo(1.02 * surface.rest[row + 2]!, 7);
    expect(surface.shown[row + 2]).toBeCloseTo(1.1 * surface.rest[row + 2]!, 7);
    surface.storeAsUntouched();
    expect(surface.untouchedAsShown(5)[row + 2]).toBeCloseTo(1.1 * surface.rest[row + 2]!, 7);
    // A ball drawn out by a tenth along z: its normals are those of that ellipsoid.
    const [x, y, z] = [0, 1, 2].map((axis) => surface.shown[row + axis]!) as Vec3;
    const normal = new THREE.Vector3(x, y, z / 1.1 ** 2).normalize();
    expect(normal.angleTo(new THREE.Vector3().fromArray(surface.shownNormals, row))).toBeLessThan(0.02);
  });
});

describe("the closest point of the surface", () => {
  it("is that of all triangles, though most are passed over", () => {
    const surface = surfaceOf(ball);
    const triangle = new THREE.Triangle();
    for (let i = 0; i < 20; i++) {
      const target = new THREE.Vector3(Math.sin(3 * i), Math.cos(5 * i), Math.sin(7 * i + 1)).setLength(0.03 + 0.003 * i);
      let nearest = Infinity;
      for (let t = 0; t < ball.triangles.length / 3; t++) {
        triangle.setFromAttributeAndIndices(new THREE.BufferAttribute(ball.positions, 3), ...surface.cornersOf(t));
        nearest = Math.min(nearest, triangle.closestPointToPoint(target, new THREE.Vector3()).distanceTo(target));
      }
      const found = surface.at(surface.untouched, closestSurfacePoint(surface, target.toArray()));
      expect(new THREE.Vector3(...found).distanceTo(target)).toBeCloseTo(nearest, 8);
    }
  });
});

it("the arrow of a force grows with it, up to a bound", () => {
  const lengths = [0, 0.1, 1, 8, 9, 1000].map((force) => arrowLength(force, 8));
  expect(lengths[0]).toBe(0);
  expect(lengths[1]).toBeLessThan(lengths[2]!);
  expect(lengths[2]).toBeLessThan(lengths[3]!);
  expect(lengths.slice(3)).toEqual([0.25, 0.25, 0.25]);
});

describe("a point of the surface between its nodes", () => {
  it("lies on the sphere that the nodes lie on, and the normal with it", () => {
    const coarse = ballOf(3);
    const surface = surfaceOf(coarse);
    let [flatError, smoothError, turned] = [0, 0, 0];
    for (let triangle = 0; triangle < coarse.triangles.length / 3; triangle++) {
      for (const weights of [[1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0.7, 0.1, 0.2]] as Vec3[]) {
        const point = { corners: surface.cornersOf(triangle), weights };
        const { place, normal } = surface.smoothPoint(point);
        flatError = Math.max(flatError, BALL - Math.hypot(...surface.at(surface.untouched, point)));
        smoothError = Math.max(smoothError, Math.abs(Math.hypot(...place) - BALL));
        turned = Math.max(turned, new THREE.Vector3(...normal).angleTo(new THREE.Vector3(...place)));
      }
    }
    // Sagitta of facets of about 17 mm, by circumradius^2 / (2 R).
    expect(flatError).toBeGreaterThan(0.6e-3);
    expect(smoothError).toBeLessThan(0.05 * flatError);
    expect(turned).toBeLessThan(0.03);
  });

  it("is the same from both triangles of an edge", () => {
    const surface = surfaceOf(ballOf(3));
    const [a, b] = surface.cornersOf(0);
    const other = Array.from({ length: surface.triangles.length / 3 }, (_, t) => surface.cornersOf(t)).find(
      (corners, t) => t > 0 && corners.includes(a) && corners.includes(b),
    )!;
    const one = surface.smoothPoint({ corners: surface.cornersOf(0), weights: [0.3, 0.7, 0] });
    const weights = other.map((corner) => (corner === a ? 0.3 : corner === b ? 0.7 : 0)) as Vec3;
    const two = surface.smoothPoint({ corners: other, weights });
    one.place.forEach((x, axis) => expect(two.place[axis]).toBeCloseTo(x, 12));
    one.normal.forEach((x, axis) => expect(two.normal[axis]).toBeCloseTo(x, 12));
  });
});

describe("the box around points", () => {
  it("has the sides of what they fill", () => {
    const sides = sidesOf(new Float32Array([1, 2, 3, -1, 2.5, 3, 0, 4, 7]));
    expect(sides).toEqual([2, 2, 4]);
  });
});
