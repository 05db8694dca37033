import * as THREE from "three";
import { describe, expect, it } from "vitest";

import { GrabGesture, PressGesture } from "./press_geometry";
import type { CameraAxes } from "./press_geometry";

const SIZE = 0.2;
const RADIUS = 0.005;

/** A camera that looks along y, right along x, up along z. */
const axes: CameraAxes = {
  right: new THREE.Vector3(1, 0, 0),
  up: new THREE.Vector3(0, 0, 1),
  forward: new THREE.Vector3(0, 1, 0),
};
const touched = { untouched: new THREE.Vector3(0.01, 0.02, 0.03), normal: new THREE.Vector3(0.6, 0, 0.8), dent: 0 };

function expectClose(a: THREE.Vector3, b: THREE.Vector3): void {
  expect(a.distanceTo(b)).toBeLessThan(1e-15);
}

describe("a press", () => {
  const press = () => new PressGesture(touched, axes, SIZE, RADIUS);

  it("begins a hundredth of the body deep, with the sphere on the normal through the point", () => {
    const centre = press().centre();
    expectClose(centre, touched.untouched.clone().addScaledVector(touched.normal, RADIUS - 0.01 * SIZE));
    expect(press().depthOf(centre)).toBeCloseTo(0.01 * SIZE, 15);
  });

  it("begins below what is seen where another tool has pressed the surface in", () => {
    const second = new PressGesture({ ...touched, dent: 0.006 }, axes, SIZE, RADIUS);
    const seen = touched.untouched.clone().addScaledVector(touched.normal, -0.006);
    expectClose(second.centre(), seen.addScaledVector(touched.normal, RADIUS - 0.01 * SIZE));
    expect(second.depthOf(second.centre())).toBeCloseTo(0.01 * SIZE + 0.006, 15);
  });

  it("goes as deep as the pointer goes down, and shears along the surface as it goes right", () => {
    const gesture = press();
    const start = gesture.centre();
    gesture.move(0, 0.004);
    expect(gesture.depthOf(gesture.centre())).toBeCloseTo(0.01 * SIZE + 0.004, 15);
    gesture.move(0.007, -0.004);
    const moved = gesture.centre().sub(start);
    expect(moved.length()).toBeCloseTo(0.007, 15);
    expect(moved.dot(touched.normal)).toBeCloseTo(0, 15);
    expect(moved.dot(axes.right)).toBeGreaterThan(0);
  });

  it("goes by the wheel as by the pointer", () => {
    const [wheeled, moved] = [press(), press()];
    wheeled.wheel(0.003);
    moved.move(0, 0.003);
    expectClose(wheeled.centre(), moved.centre());
  });

  it("stops at its limits, and turns back there at once", () => {
    const gesture = press();
    for (let i = 0; i < 100; i++) gesture.move(0.01, 0.01);
    expect(gesture.depthOf(gesture.centre())).toBeCloseTo(0.25 * SIZE, 12);
    gesture.move(0, -0.001);
    expect(gesture.depthOf(gesture.centre())).toBeCloseTo(0.25 * SIZE - 0.001, 12);
    for (let i = 0; i < 100; i++) gesture.move(0, -0.01);
    expect(gesture.depthOf(gesture.centre())).toBeCloseTo(-0.05 * SIZE, 12);
  });
});

describe("a grab", () => {
  const grab = () => new GrabGesture(touched, axes, SIZE);

  it("takes hold of the point itself", () => {
    expectClose(grab().centre(), touched.untouched);
    expect(grab().depthOf(touched.untouched)).toBe(0);
  });

  it("follows the pointer across the line of sight, and the wheel along it", () => {
    const gesture = grab();
    gesture.move(0.003, 0.004);
    expectClose(gesture.centre(), touched.untouched.clone().add(new THREE.Vector3(0.003, 0, -0.004)));
    expect(gesture.depthOf(gesture.centre())).toBeCloseTo(0.005, 15);
    gesture.wheel(0.012);
    expect(gesture.depthOf(gesture.centre())).toBeCloseTo(0.013, 15);
  });

  it("pulls a quarter of the body at most, in the direction of the pointer", () => {
    const gesture = grab();
    gesture.move(10, 0);
    expectClose(gesture.centre(), touched.untouched.clone().add(new THREE.Vector3(0.25 * SIZE, 0, 0)));
  });
});
