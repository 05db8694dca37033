// From movements of the pointer to the pose of the tool. A press starts where the tool just touches; the tool then keeps
// on the surface under the pointer, and how deep it is has a goal of its own. Lengths in m, places of the window in pixels.

import * as THREE from "three";

import { originAt } from "../scene/tool_shape";
import type { SurfaceSpot, ToolShape } from "../scene/tool_shape";
import type { Posture } from "../store";
import type { Place } from "../window_regions";

/** Depth, over the tool's radius, that a button held down leads to; of a pen, at full pressure; and of a notch of the wheel. */
export const GENTLE_DEPTH = 0.4;
export const PEN_DEPTH = 2;
const NOTCH_DEPTH = 0.1;
/** Depth follows its goal in about 5 of these times, s: half a second from the touch to a gentle press. */
const DEPTH_LAG_S = 0.1;
/** Speed of the depth, tool radii a second, and of the tool, body sizes a second. */
const DEPTH_SPEED_MAX = 6;
const SPEED_MAX = 5;
/** Of the size of the body; and how far a press may be lifted off, over the tool's radius, without letting go. */
const DEPTH_MAX = 0.25;
const LIFT_MAX = 1;
/** While the tool is held for strain its depth is taken so much farther, over the tool's radius: turning back is felt at once. */
const LIMITED_MARGIN = 0.5;
/** A drag for depth goes so much slower than the pointer. */
const DEPTH_PER_DRAG = 0.25;
const PULL_MAX = 0.25;
/** Closer than this, over the radius of the tool, is there. */
const GOAL_TOLERANCE = 1e-4;
/** Halvings that find the outline of a body between two places of the pointer. */
const HALVINGS = 8;

export interface CameraAxes {
  right: THREE.Vector3;
  up: THREE.Vector3;
  /** Away from the viewer. */
  forward: THREE.Vector3;
}

/** A tool in the hand. */
export interface HeldTool {
  shape: ToolShape;
  /** By which depths are measured. */
  radius: number;
  /** How it stands on a surface with this outward normal; null for a tool that looks the same from all sides. */
  orientationOn(normal: THREE.Vector3): THREE.Quaternion | null;
}

/** What the pointer meets of the body that it presses. */
export interface SurfaceHit {
  axes: CameraAxes;
  metresPerPixel: number;
  /** The point of the untouched surface under a place of the window; null beside the body. */
  surfaceAt(place: Place): SurfaceSpot | null;
}

/** What a movement of the pointer is for. */
export type Purpose = "slide" | "deepen" | "stay";

/** What the pointer does with the body until it is let go. */
export interface Gesture {
  readonly grab: boolean;
  /** The pointer goes to a place; to `deepen` it only changes the depth, down is deeper; to `stay` it does something else. */
  moveTo(place: Place, to: Purpose): void;
  /** Away from the viewer is positive. */
  wheel(notches: number): void;
  /** From 0 to 1. */
  press(pressure: number): void;
  /** Whether the tool is held, for the body would be strained too far. */
  hold(held: boolean): void;
  /** Lets time pass and returns whether the tool moves on. */
  advance(seconds: number): boolean;
  /** Of the tool's origin. */
  position(): THREE.Vector3;
  /** null where the tool need not be turned. */
  orientation(): THREE.Quaternion | null;
  /** Depth of a press, length of a pull, as the pointer has it now. */
  readonly depth: number;
}

/** A value that follows a goal, and its rate. */
export interface SmoothedValue {
  value: number;
  rate: number;
}

/**
 * A critically damped approach to a goal: `x'' = (g - x) / T^2 - 2 x' / T`, exact for any step, and never faster than `rateMax`.
 *
 * A goal farther than `2 T rateMax` is taken for one at that distance: then `x'' <= (2 / T) (rateMax - x')`, so that a rate
 * within the bound stays there.
 */
export function approach({ value, rate }: SmoothedValue, goal: number, seconds: number, lag: number, rateMax: number): SmoothedValue {
  const reach = 2 * lag * rateMax;
  const near = value + THREE.MathUtils.clamp(goal - value, -reach, reach);
  const [gap, decay] = [value - near, Math.exp(-seconds / lag)];
  const slope = rate + gap / lag;
  return {
    value: near + (gap + slope * seconds) * decay,
    rate: (rate - (slope * seconds) / lag) * decay,
  };
}

/**
 * A tool that leans by `tilt` from the outward normal of a surface, towards a direction that is `turn` from the right of the
 * picture. The frame of the camera, turned the shortest way until it looks along the normal, is where both are zero:
 * nothing that is seen faces away, where there would be no shortest way.
 */
export function orientationOn(normal: THREE.Vector3, { right, up, forward }: CameraAxes, { tilt, turn }: Posture): THREE.Quaternion {
  const backward = forward.clone().negate();
  const camera = new THREE.Quaternion().setFromRotationMatrix(new THREE.Matrix4().makeBasis(right, up, backward));
  const facing = new THREE.Quaternion().setFromUnitVectors(backward, normal).multiply(camera);
  const [turned, tilted] = [new THREE.Quaternion(), new THREE.Quaternion()];
  turned.setFromAxisAngle(new THREE.Vector3(0, 0, 1), THREE.MathUtils.degToRad(turn));
  tilted.setFromAxisAngle(new THREE.Vector3(0, 1, 0), THREE.MathUtils.degToRad(tilt));
  return facing.multiply(turned).multiply(tilted).normalize();
}

/** The last place that is still on the body, on the way from one that is to one beside it. */
export function outline(on: Place, beside: Place, isOn: (place: Place) => boolean): Place {
  let [inner, outer] = [on, beside];
  for (let i = 0; i < HALVINGS; i++) {
    const middle: Place = [(inner[0] + outer[0]) / 2, (inner[1] + outer[1]) / 2];
    if (isOn(middle)) inner = middle;
    else outer = middle;
  }
  return inner;
}

/** The tool slides on the surface under the pointer; beside the body it goes on across the line of sight, and so rolls off. */
export class PressGesture implements Gesture {
  readonly grab = false;
  private following: SmoothedValue;
  private goal: number;
  private readonly dent: number;
  /** Depth at which the tool came to be held. */
  private heldAt: number | null = null;
  private pointer: Place;
  /** The place of the window that the tool follows: the pointer's, but for what was moved for depth alone. */
  private aim: Place;
  /** The last aim on the body, the surface there, and how far beside the body the tool is from it. */
  private onBody: Place;
  private touched: SurfaceSpot;
  private readonly beside = new THREE.Vector3();
  /** Origin of the tool; it goes where the pointer wants it no faster than a hand. */
  private readonly at: THREE.Vector3;

  /**
   * `dent` is how deep the surface lies already, by another tool; a press that goes `straight` in waits for its depth
   * to be told. `aim` is where the touched point is seen while nothing touches the body.
   */
  constructor(
    first: SurfaceSpot & { dent: number },
    private readonly sight: SurfaceHit,
    private readonly size: number,
    private readonly tool: HeldTool,
    { pointer, aim, straight }: { pointer: Place; aim: Place; straight: boolean },
  ) {
    this.touched = { point: first.point.clone(), normal: first.normal.clone() };
    this.following = { value: first.dent, rate: 0 };
    this.dent = first.dent;
    this.goal = this.dent + (straight ? 0 : GENTLE_DEPTH * tool.radius);
    this.pointer = pointer;
    this.aim = this.onBody = aim;
    this.at = this.wanted();
  }

  get depth(): number {
    return this.following.value;
  }

  moveTo(place: Place, to: Purpose): void {
    const [right, down] = [place[0] - this.pointer[0], place[1] - this.pointer[1]];
    this.pointer = place;
    if (to === "stay") return;
    if (to === "deepen") return this.deepen(DEPTH_PER_DRAG * this.sight.metresPerPixel * down);
    this.aim = [this.aim[0] + right, this.aim[1] + down];
    this.slide();
  }

  wheel(notches: number): void {
    this.deepen(notches * NOTCH_DEPTH * this.tool.radius);
  }

  press(pressure: number): void {
    this.goal = this.dent + pressure * PEN_DEPTH * this.tool.radius;
  }

  hold(held: boolean): void {
    this.heldAt = held ? (this.heldAt ?? this.depth) : null;
  }

  advance(seconds: number): boolean {
    const near = GOAL_TOLERANCE * this.tool.radius;
    this.following = approach(this.following, this.goal, seconds, DEPTH_LAG_S, DEPTH_SPEED_MAX * this.tool.radius);
    const deepened = Math.abs(this.goal - this.following.value) < near && Math.abs(this.following.rate) < near;
    if (deepened) this.following = { value: this.goal, rate: 0 };
    const [way, reach] = [this.wanted().sub(this.at), SPEED_MAX * this.size * seconds];
    const arrived = way.length() <= reach;
    this.at.add(way.clampLength(0, reach));
    return !deepened || !arrived;
  }

  position(): THREE.Vector3 {
    return this.at.clone();
  }

  orientation(): THREE.Quaternion | null {
    return this.tool.orientationOn(this.touched.normal);
  }

  private deepen(metres: number): void {
    const room = this.heldAt === null ? Infinity : this.heldAt + LIMITED_MARGIN * this.tool.radius;
    const deepest = Math.min(DEPTH_MAX * this.size, Math.max(room, this.goal));
    this.goal = THREE.MathUtils.clamp(this.goal + metres, -LIFT_MAX * this.tool.radius, deepest);
  }

  private slide(): void {
    const found = this.sight.surfaceAt(this.aim);
    if (found) {
      this.touched = found;
      this.onBody = this.aim;
      this.beside.set(0, 0, 0);
      return;
    }
    this.onBody = outline(this.onBody, this.aim, (place) => this.sight.surfaceAt(place) !== null);
    this.touched = this.sight.surfaceAt(this.onBody) ?? this.touched;
    const { axes, metresPerPixel } = this.sight;
    this.beside.copy(axes.right).multiplyScalar((this.aim[0] - this.onBody[0]) * metresPerPixel);
    this.beside.addScaledVector(axes.up, (this.onBody[1] - this.aim[1]) * metresPerPixel);
  }

  private wanted(): THREE.Vector3 {
    const orientation = this.orientation() ?? new THREE.Quaternion();
    return originAt(this.tool.shape, orientation, this.touched, this.depth).add(this.beside);
  }
}

/** The grabbed point follows the pointer in the plane through it that faces the camera. */
export class GrabGesture implements Gesture {
  readonly grab = true;
  private readonly pull = new THREE.Vector3();

  /** A notch of the wheel moves by a part of the size of the body. */
  static readonly NOTCH = 0.002;

  constructor(
    private readonly held: THREE.Vector3,
    private readonly sight: Omit<SurfaceHit, "surfaceAt">,
    private readonly size: number,
    private pointer: Place,
    private readonly turned: THREE.Quaternion | null,
  ) {}

  get depth(): number {
    return this.pull.length();
  }

  moveTo(place: Place): void {
    const { axes, metresPerPixel } = this.sight;
    this.pull.addScaledVector(axes.right, (place[0] - this.pointer[0]) * metresPerPixel);
    this.pull.addScaledVector(axes.up, (this.pointer[1] - place[1]) * metresPerPixel);
    this.pull.clampLength(0, PULL_MAX * this.size);
    this.pointer = place;
  }

  wheel(notches: number): void {
    this.pull.addScaledVector(this.sight.axes.forward, notches * GrabGesture.NOTCH * this.size);
    this.pull.clampLength(0, PULL_MAX * this.size);
  }

  /** How hard a pen is pressed does not move what is held. */
  press(): void {}

  hold(): void {}

  advance(): boolean {
    return false;
  }

  // The tool takes hold where its origin is when the grab begins, so that is the touched point itself.
  position(): THREE.Vector3 {
    return this.held.clone().add(this.pull);
  }

  orientation(): THREE.Quaternion | null {
    return this.turned;
  }
}
