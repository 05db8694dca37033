import * as THREE from "three";
import { describe, expect, it } from "vitest";

import { originAt, toolShape } from "../scene/tool_shape";
import type { SurfaceSpot } from "../scene/tool_shape";
import { GENTLE_DEPTH, GrabGesture, PEN_DEPTH, PressGesture, approach, orientationOn, outline } from "./press_geometry";
import type { CameraAxes, HeldTool, SurfaceHit } from "./press_geometry";
import type { Place } from "../window_regions";

const SIZE = 0.2;
const RADIUS = 0.01;
const METRES_PER_PIXEL = 2e-4;
const MIDDLE: Place = [500, 400];
const FRAME_S = 0.008;
const NO_SURFACE = { vertices: new Float32Array(), triangles: new Uint32Array() };

/** A camera that looks along y, right along x, up along z. */
const axes: CameraAxes = {
  right: new THREE.Vector3(1, 0, 0),
  up: new THREE.Vector3(0, 0, 1),
  forward: new THREE.Vector3(0, 1, 0),
};

/** A ball of 50 mm around the origin, seen from far away. */
const BALL = 0.05;
function onBall([x, y]: Place): SurfaceSpot | null {
  const [right, up] = [(x - MIDDLE[0]) * METRES_PER_PIXEL, (MIDDLE[1] - y) * METRES_PER_PIXEL];
  const squared = BALL ** 2 - right ** 2 - up ** 2;
  if (squared < 0) return null;
  const point = new THREE.Vector3(right, -Math.sqrt(squared), up);
  return { point, normal: point.clone().normalize() };
}
const sight: SurfaceHit = { axes, metresPerPixel: METRES_PER_PIXEL, surfaceAt: onBall };

const ball = toolShape({ shape: "sphere", lengths: [RADIUS, 0, 0] }, NO_SURFACE);
const BALL_IN_HAND: HeldTool = { shape: ball, radius: RADIUS, orientationOn: () => null };
/** Origin of the ball at a depth. */
const centreAt = (spot: SurfaceSpot, depth: number) => originAt(ball, new THREE.Quaternion(), spot, depth);

function pressOn(pointer: Place, { dent = 0, straight = false, aim = pointer } = {}): PressGesture {
  return new PressGesture({ ...onBall(aim)!, dent }, sight, SIZE, BALL_IN_HAND, { pointer, aim, straight });
}

function settle(gesture: PressGesture, seconds = 3): PressGesture {
  for (let t = 0; t < seconds; t += FRAME_S) gesture.advance(FRAME_S);
  return gesture;
}

/** Depth of the tool below the ball, by the distance of its centre from that of the ball. */
const depthIn = (gesture: PressGesture) => BALL + RADIUS - gesture.position().length();

describe("the depth", () => {
  it("follows its goal as the differential equation says", () => {
    const [goal, lag, step] = [0.004, 0.1, 1e-5];
    let [value, rate] = [0, 0];
    for (let t = 0; t < 0.25; t += step) {
      rate += step * ((goal - value) / lag ** 2 - (2 * rate) / lag);
      value += step * rate;
    }
    const once = approach({ value: 0, rate: 0 }, goal, 0.25, lag, 1);
    expect(once.value).toBeCloseTo(value, 6);
    expect(once.rate).toBeCloseTo(rate, 5);
    const half = approach({ value: 0, rate: 0 }, goal, 0.1, lag, 1);
    expect(approach(half, goal, 0.15, lag, 1).value).toBeCloseTo(once.value, 15);
  });

  it("is never faster than its bound, however far the goal", () => {
    let following = { value: 0, rate: 0 };
    let fastest = 0;
    for (let i = 0; i < 400; i++) {
      following = approach(following, i < 200 ? 5 : -5, 0.004, 0.1, 0.06);
      fastest = Math.max(fastest, Math.abs(following.rate));
    }
    expect(fastest).toBeLessThanOrEqual(0.06);
    expect(fastest).toBeGreaterThan(0.055);
  });
});

describe("a press", () => {
  it("begins where the tool just touches the point under the pointer", () => {
    for (const place of [MIDDLE, [600, 300]] as Place[]) {
      const gesture = pressOn(place);
      expect(gesture.position().distanceTo(centreAt(onBall(place)!, 0))).toBeLessThan(1e-15);
      expect(depthIn(gesture)).toBeCloseTo(0, 15);
    }
  });

  it("held still is a gentle one within half a second, some millimetres in a tenth of a second at most", () => {
    const gesture = pressOn(MIDDLE);
    let [before, fastest] = [0, 0];
    for (let t = 0; t < 0.5; t += FRAME_S) {
      gesture.advance(FRAME_S);
      fastest = Math.max(fastest, (depthIn(gesture) - before) / FRAME_S);
      expect(depthIn(gesture)).toBeGreaterThan(before);
      before = depthIn(gesture);
    }
    expect(before / (GENTLE_DEPTH * RADIUS)).toBeGreaterThan(0.95);
    expect(fastest).toBeLessThan(0.03);
    expect(depthIn(settle(gesture))).toBeCloseTo(GENTLE_DEPTH * RADIUS, 12);
    expect(gesture.advance(FRAME_S)).toBe(false);
  });

  it("begins below what is seen where another tool has pressed the surface in", () => {
    const gesture = pressOn(MIDDLE, { dent: 0.006 });
    expect(depthIn(gesture)).toBeCloseTo(0.006, 15);
    expect(depthIn(settle(gesture))).toBeCloseTo(0.006 + GENTLE_DEPTH * RADIUS, 12);
  });

  it("slides on the surface under the pointer at the same depth", () => {
    const gesture = settle(pressOn(MIDDLE));
    for (let step = 1; step <= 40; step++) {
      gesture.moveTo([MIDDLE[0] + 5 * step, MIDDLE[1]], "slide");
      gesture.advance(FRAME_S);
      expect(depthIn(gesture)).toBeCloseTo(GENTLE_DEPTH * RADIUS, 12);
    }
    const there = onBall([700, 400])!;
    expect(gesture.position().distanceTo(centreAt(there, GENTLE_DEPTH * RADIUS))).toBeLessThan(1e-12);
  });

  it("rolls off beside the body without a jump, and comes back", () => {
    const gesture = settle(pressOn(MIDDLE));
    let [before, longest, shallowest] = [gesture.position(), 0, Infinity];
    const place = (x: number) => {
      gesture.moveTo([x, MIDDLE[1]], "slide");
      gesture.advance(FRAME_S);
      longest = Math.max(longest, gesture.position().distanceTo(before));
      shallowest = Math.min(shallowest, depthIn(gesture));
      before = gesture.position();
    };
    for (let x = MIDDLE[0]; x <= 820; x += 2) place(x);
    expect(gesture.position().x).toBeCloseTo(BALL + RADIUS - GENTLE_DEPTH * RADIUS + 70 * METRES_PER_PIXEL, 4);
    expect(shallowest).toBeLessThan(-0.005);
    for (let x = 820; x >= MIDDLE[0]; x -= 2) place(x);
    expect(depthIn(settle(gesture))).toBeCloseTo(GENTLE_DEPTH * RADIUS, 12);
    expect(longest).toBeLessThanOrEqual(5 * SIZE * FRAME_S * (1 + 1e-9));
  });

  it("leaves at the outline, however far the pointer went at once", () => {
    const gesture = settle(pressOn(MIDDLE));
    gesture.moveTo([900, MIDDLE[1]], "slide");
    settle(gesture);
    const edge = outline(MIDDLE, [900, MIDDLE[1]], (place) => onBall(place) !== null);
    expect(Math.abs(edge[0] - 750)).toBeLessThan(400 / 2 ** 8);
    expect(gesture.position().x).toBeCloseTo(0.4 * RADIUS + 0.2 * RADIUS + BALL + 150 * METRES_PER_PIXEL, 3);
  });

  it("goes straight in along the normal of the first point while only its depth is moved", () => {
    const place: Place = [600, 320];
    const { point, normal } = onBall(place)!;
    const gesture = pressOn(place, { straight: true });
    expect(depthIn(settle(gesture))).toBeCloseTo(0, 12);
    gesture.moveTo([640, 420], "deepen");
    settle(gesture);
    const deep = 0.25 * 100 * METRES_PER_PIXEL;
    expect(gesture.position().distanceTo(centreAt({ point, normal }, deep))).toBeLessThan(1e-12);
    // Sliding goes on from the point it had, not from under the pointer.
    gesture.moveTo([641, 420], "slide");
    settle(gesture);
    expect(gesture.position().distanceTo(centreAt(onBall([601, 320])!, deep))).toBeLessThan(1e-12);
  });

  it("goes by the wheel a tenth of the tool's radius a notch, and stops at its limits", () => {
    const gesture = settle(pressOn(MIDDLE));
    gesture.wheel(3);
    expect(depthIn(settle(gesture))).toBeCloseTo((GENTLE_DEPTH + 0.3) * RADIUS, 12);
    gesture.wheel(1000);
    expect(depthIn(settle(gesture))).toBeCloseTo(0.25 * SIZE, 12);
    // Turning back at a limit is felt at once.
    gesture.wheel(-1);
    expect(depthIn(settle(gesture))).toBeCloseTo(0.25 * SIZE - 0.1 * RADIUS, 12);
    gesture.wheel(-1000);
    expect(depthIn(settle(gesture))).toBeCloseTo(-RADIUS, 12);
  });

  it("goes half a radius on while the tool is held, and farther when it is let go", () => {
    const gesture = settle(pressOn(MIDDLE));
    gesture.hold(true);
    for (let i = 0; i < 30; i++) gesture.wheel(1);
    expect(depthIn(settle(gesture))).toBeCloseTo((GENTLE_DEPTH + 0.5) * RADIUS, 12);
    gesture.hold(true);
    gesture.wheel(1);
    expect(depthIn(settle(gesture))).toBeCloseTo((GENTLE_DEPTH + 0.5) * RADIUS, 12);
    gesture.wheel(-1);
    expect(depthIn(settle(gesture))).toBeCloseTo((GENTLE_DEPTH + 0.4) * RADIUS, 12);
    gesture.hold(false);
    gesture.wheel(10);
    expect(depthIn(settle(gesture))).toBeCloseTo((GENTLE_DEPTH + 1.4) * RADIUS, 12);
  });

  it("is as deep as a pen is pressed", () => {
    const gesture = pressOn(MIDDLE);
    for (const pressure of [0.2, 1, 0.5]) {
      gesture.press(pressure);
      expect(depthIn(settle(gesture))).toBeCloseTo(pressure * PEN_DEPTH * RADIUS, 12);
    }
  });
});

describe("a grab", () => {
  const held = new THREE.Vector3(0.01, 0.02, 0.03);
  const grab = () => new GrabGesture(held, { axes, metresPerPixel: METRES_PER_PIXEL }, SIZE, MIDDLE, null);

  it("holds the touched point itself and follows the pointer across the line of sight", () => {
    const gesture = grab();
    expect(gesture.position().distanceTo(held)).toBe(0);
    gesture.moveTo([MIDDLE[0] + 30, MIDDLE[1] + 20]);
    expect(gesture.position().distanceTo(held.clone().add(new THREE.Vector3(0.006, 0, -0.004)))).toBeLessThan(1e-15);
    gesture.wheel(10);
    const away = held.clone().add(new THREE.Vector3(0.006, 0.004, -0.004));
    expect(gesture.position().distanceTo(away)).toBeLessThan(1e-15);
    expect(gesture.depth).toBeCloseTo(Math.hypot(0.006, 0.004, 0.004), 15);
  });

  it("pulls a quarter of the body at most, in the direction of the pointer", () => {
    const gesture = grab();
    gesture.moveTo([MIDDLE[0] + 1e5, MIDDLE[1]]);
    expect(gesture.position().distanceTo(held.clone().add(new THREE.Vector3(0.25 * SIZE, 0, 0)))).toBeLessThan(1e-15);
  });
});

describe("a tool that is held at an angle", () => {
  const upright = { tilt: 0, turn: 0 };
  const z = new THREE.Vector3(0, 0, 1);

  it("stands on the normal, and leans from it by the tilt, to where it is turned", () => {
    for (const place of [MIDDLE, [600, 300], [380, 520]] as Place[]) {
      const { normal } = onBall(place)!;
      for (const tilt of [0, 30, 90]) {
        for (const turn of [-120, 0, 45]) {
          const axis = z.clone().applyQuaternion(orientationOn(normal, axes, { tilt, turn }));
          expect(axis.dot(normal)).toBeCloseTo(Math.cos(THREE.MathUtils.degToRad(tilt)), 12);
        }
      }
    }
    // Where the surface faces the camera, right and up of the picture.
    const { normal } = onBall(MIDDLE)!;
    const lying = (turn: number) => z.clone().applyQuaternion(orientationOn(normal, axes, { tilt: 90, turn }));
    expect(lying(0).distanceTo(axes.right)).toBeLessThan(1e-12);
    expect(lying(90).distanceTo(axes.up)).toBeLessThan(1e-12);
  });

  it("slides at the same depth whichever way it leans, and follows the surface", () => {
    const posture = { ...upright };
    const capsule = toolShape({ shape: "capsule", lengths: [0.5 * RADIUS, 3 * RADIUS, 0] }, NO_SURFACE);
    const tool: HeldTool = { shape: capsule, radius: RADIUS, orientationOn: (n) => orientationOn(n, axes, posture) };
    const gesture = new PressGesture({ ...onBall(MIDDLE)!, dent: 0 }, sight, SIZE, tool, {
      pointer: MIDDLE,
      aim: MIDDLE,
      straight: false,
    });
    for (const tilt of [0, 50, 90]) {
      posture.tilt = tilt;
      gesture.moveTo([MIDDLE[0] + tilt, MIDDLE[1] + 20], "slide");
      settle(gesture);
      const { normal, point } = onBall([MIDDLE[0] + tilt, MIDDLE[1] + 20])!;
      const [place, turned] = [gesture.position(), gesture.orientation()!];
      const heights = [0, 3 * RADIUS].map((along) => new THREE.Vector3(0, 0, along).applyQuaternion(turned).add(place));
      const lowest = Math.min(...heights.map((end) => end.sub(point).dot(normal))) - 0.5 * RADIUS;
      expect(lowest).toBeCloseTo(-GENTLE_DEPTH * RADIUS, 12);
    }
    const before = gesture.position();
    gesture.moveTo([900, 900], "stay");
    settle(gesture);
    expect(gesture.position().distanceTo(before)).toBe(0);
  });
});
