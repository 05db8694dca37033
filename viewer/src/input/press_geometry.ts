// From movements of the pointer, in m across the line of sight, to the centre of the tool.

import * as THREE from "three";

import type { Pick } from "../scene/body_view";

/** Depth of a press below what is seen at the moment it begins, over the size of the body: a click is felt at once. */
const DEPTH_AT_START = 0.01;
const DEPTH_MAX = 0.25;
/** A press may be lifted this far off the surface without letting go of the button. */
const LIFT_MAX = 0.05;
const SHEAR_MAX = 0.25;
const PULL_MAX = 0.25;

export interface CameraAxes {
  right: THREE.Vector3;
  up: THREE.Vector3;
  /** Away from the viewer. */
  forward: THREE.Vector3;
}

/** Where a gesture begins: a point of the untouched surface, the outward normal and the dent there. */
export type Touched = { [Key in "untouched" | "normal" | "dent"]: Pick[Key] };

/** What the pointer does with the body until it is let go. Lengths in m. */
export interface Gesture {
  readonly grab: boolean;
  /** right and down as seen; inward away from the viewer, by the wheel. */
  move(right: number, down: number): void;
  wheel(inward: number): void;
  /** Centre of the tool. */
  centre(): THREE.Vector3;
  /** Depth of a press, length of a pull, with the tool's centre at a place. */
  depthOf(centre: THREE.Vector3): number;
}

/** Down pushes into the body along its normal, up lifts, left and right shear along the surface. */
export class PressGesture implements Gesture {
  readonly grab = false;
  private pushed: number;
  private sheared = 0;
  private readonly tangent: THREE.Vector3;

  constructor(
    private readonly pick: Touched,
    axes: CameraAxes,
    private readonly size: number,
    private readonly toolRadius: number,
  ) {
    this.pushed = DEPTH_AT_START * size + pick.dent;
    this.tangent = axes.right.clone().projectOnPlane(pick.normal).normalize();
  }

  move(right: number, down: number): void {
    // Clamped step by step, so that turning back at a limit is felt at once.
    this.pushed = THREE.MathUtils.clamp(this.pushed + down, -LIFT_MAX * this.size, DEPTH_MAX * this.size);
    this.sheared = THREE.MathUtils.clamp(this.sheared + right, -SHEAR_MAX * this.size, SHEAR_MAX * this.size);
  }

  wheel(inward: number): void {
    this.move(0, inward);
  }

  centre(): THREE.Vector3 {
    return this.pick.untouched
      .clone()
      .addScaledVector(this.pick.normal, this.toolRadius - this.pushed)
      .addScaledVector(this.tangent, this.sheared);
  }

  depthOf(centre: THREE.Vector3): number {
    return this.toolRadius - centre.clone().sub(this.pick.untouched).dot(this.pick.normal);
  }
}

/** The grabbed point follows the pointer in the plane through it that faces the camera. */
export class GrabGesture implements Gesture {
  readonly grab = true;
  private readonly pull = new THREE.Vector3();

  constructor(
    private readonly pick: Touched,
    private readonly axes: CameraAxes,
    private readonly size: number,
  ) {}

  move(right: number, down: number): void {
    this.pull.addScaledVector(this.axes.right, right).addScaledVector(this.axes.up, -down);
    this.pull.clampLength(0, PULL_MAX * this.size);
  }

  wheel(inward: number): void {
    this.pull.addScaledVector(this.axes.forward, inward).clampLength(0, PULL_MAX * this.size);
  }

  // The tool takes hold where its centre is when the grab begins, so that is the touched point itself.
  centre(): THREE.Vector3 {
    return this.pick.untouched.clone().add(this.pull);
  }

  depthOf(centre: THREE.Vector3): number {
    return centre.distanceTo(this.pick.untouched);
  }
}
