import * as THREE from "three";
import { describe, expect, it } from "vitest";

import type { ShapeName, ToolArrays, ToolMessage } from "../net/protocol";
import { originAt, toolShape } from "./tool_shape";

type ShapeEntry = Pick<ToolMessage, "shape" | "lengths">;
const NOTHING: ToolArrays = { vertices: new Float32Array(), triangles: new Uint32Array() };
const [R, L, ROUNDING] = [0.004, 0.02, 0.0015];
const CLOSED: Record<Exclude<ShapeName, "surface">, ShapeEntry> = {
  sphere: { shape: "sphere", lengths: [R, 0, 0] },
  ellipsoid: { shape: "ellipsoid", lengths: [0.008, 0.006, 0.005] },
  capsule: { shape: "capsule", lengths: [R, L, 0] },
  punch: { shape: "punch", lengths: [R, ROUNDING, 0] },
};
/** Of bodies of revolution by Pappus; the quarter of a circle that rounds a rim has its centroid 4 r/(3 pi) from the centre. */
const FLAT = R - ROUNDING;
const VOLUMES = {
  sphere: (4 / 3) * Math.PI * R ** 3,
  ellipsoid: (4 / 3) * Math.PI * 0.008 * 0.006 * 0.005,
  capsule: (4 / 3) * Math.PI * R ** 3 + Math.PI * R ** 2 * L,
  punch:
    Math.PI * FLAT ** 2 * 4 * R +
    2 * Math.PI * (FLAT + ROUNDING / 2) * ROUNDING * (4 * R - 2 * ROUNDING) +
    4 * Math.PI * (FLAT + (4 * ROUNDING) / (3 * Math.PI)) * ((Math.PI * ROUNDING ** 2) / 4),
};

/** A box with its front in the plane z = 0. */
const BOX: ToolArrays = (() => {
  const box = new THREE.BoxGeometry(0.02, 0.01, 0.03).translate(0, 0, 0.015);
  return {
    vertices: new Float32Array(box.getAttribute("position").array),
    triangles: new Uint32Array(box.getIndex()!.array),
  };
})();

function directions(count: number): THREE.Vector3[] {
  // Evenly over the ball, by the golden angle.
  return Array.from({ length: count }, (_, i) => {
    const [z, turn] = [1 - (2 * i + 1) / count, i * Math.PI * (3 - Math.sqrt(5))];
    return new THREE.Vector3(Math.cos(turn), Math.sin(turn), 0).multiplyScalar(Math.sqrt(1 - z * z)).setZ(z);
  });
}

function corners(geometry: THREE.BufferGeometry): THREE.Vector3[] {
  const flat = geometry.index ? geometry.toNonIndexed() : geometry;
  const places = flat.getAttribute("position");
  return Array.from({ length: places.count }, (_, i) => new THREE.Vector3().fromBufferAttribute(places, i));
}

/** By the divergence theorem: negative where the faces look inwards. */
function volume(geometry: THREE.BufferGeometry): number {
  const places = corners(geometry);
  let sum = 0;
  for (let i = 0; i < places.length; i += 3) sum += places[i]!.dot(places[i + 1]!.clone().cross(places[i + 2]!)) / 6;
  return sum;
}

describe.each(Object.keys(CLOSED) as (keyof typeof CLOSED)[])("a tool that is a %s", (name) => {
  const shape = toolShape(CLOSED[name], NOTHING);

  it("is drawn as large as it is, seen from outside", () => {
    expect(volume(shape.geometry()) / VOLUMES[name]).toBeCloseTo(1, 1.7);
  });

  it("reaches as far as what is drawn of it", () => {
    const places = corners(shape.geometry());
    for (const direction of directions(60)) {
      const drawn = Math.max(...places.map((place) => place.dot(direction)));
      expect(shape.reach(direction)).toBeGreaterThanOrEqual(drawn - 1e-9);
      expect(shape.reach(direction) - drawn).toBeLessThan(0.02 * R);
    }
  });

  it("stands on a point of its own, which does not jump", () => {
    for (const direction of directions(60)) {
      const foot = shape.supportPoint(direction);
      expect(foot.dot(direction)).toBeLessThanOrEqual(shape.reach(direction) + 1e-12);
      const [along] = directions(7).map((d) => d.cross(direction));
      const near = direction.clone().addScaledVector(along!, 1e-3).normalize();
      expect(shape.supportPoint(near).distanceTo(foot)).toBeLessThan(0.02 * (R + L));
    }
  });
});

it("a stylus on its side stands on its middle, upright on its front, and so does a punch", () => {
  const [side, down] = [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 0, -1)];
  const capsule = toolShape(CLOSED.capsule, NOTHING);
  expect(capsule.supportPoint(side).toArray()).toEqual([R, 0, L / 2]);
  expect(capsule.supportPoint(down).distanceTo(new THREE.Vector3(0, 0, -R))).toBe(0);
  const punch = toolShape(CLOSED.punch, NOTHING);
  expect(punch.supportPoint(down).length()).toBeLessThan(1e-18);
  expect(punch.supportPoint(side).distanceTo(new THREE.Vector3(R, 0, 2 * R))).toBeLessThan(1e-15);
});

it("a tool from a file is its surface, and stands on the middle of a face", () => {
  const box = toolShape({ shape: "surface", lengths: [0, 0, 0] }, BOX);
  expect(volume(box.geometry())).toBeCloseTo(0.02 * 0.01 * 0.03, 12);
  expect(box.reach(new THREE.Vector3(0.6, 0, 0.8))).toBeCloseTo(0.6 * 0.01 + 0.8 * 0.03, 8);
  expect(box.supportPoint(new THREE.Vector3(0, 0, -1)).length()).toBeLessThan(1e-9);
});

it("a tool that is turned just touches the plane below, at any depth", () => {
  const spot = { point: new THREE.Vector3(0.1, -0.2, 0.3), normal: new THREE.Vector3(1, 2, 2).divideScalar(3) };
  for (const entry of Object.values(CLOSED)) {
    const shape = toolShape(entry, NOTHING);
    for (const direction of directions(20)) {
      const turned = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), direction);
      const origin = originAt(shape, turned, spot, 1e-3);
      const heights = corners(shape.geometry()).map((p) => p.applyQuaternion(turned).add(origin).sub(spot.point).dot(spot.normal));
      expect(Math.abs(Math.min(...heights) + 1e-3)).toBeLessThan(0.02 * R);
    }
  }
});
