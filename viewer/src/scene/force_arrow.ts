// The force on a device as an arrow, drawn over everything: a dent would hide it.

import * as THREE from "three";

import type { Vec3 } from "../net/protocol";

const COLOR = 0xffb454;
/** Length of the arrow at the largest force, over the size of the scene; it goes with the root, for a finger's range is wide. */
const LENGTH_AT_MAX_FORCE = 0.25;
/** However close the camera, no longer than this part of the height of the picture. */
const LENGTH_IN_PICTURE = 0.25;
/** Shorter arrows than this (over the size of the scene) are not drawn, N below noise are not either. */
const LENGTH_MIN = 0.01;
/** Radii of shaft and head and length of the head, over the size of the scene. */
const SHAFT_RADIUS = 0.0035;
const HEAD_RADIUS = 0.011;
const HEAD_LENGTH = 0.034;
const UP = new THREE.Vector3(0, 1, 0);

export class ForceArrow {
  readonly group = new THREE.Group();
  private readonly shaft: THREE.Mesh<THREE.CylinderGeometry, THREE.MeshBasicMaterial>;
  private readonly head: THREE.Mesh<THREE.ConeGeometry, THREE.MeshBasicMaterial>;
  private length = 0;

  constructor(private readonly size: number, private readonly maxForce: number) {
    const look = { color: COLOR, depthTest: false, depthWrite: false, transparent: true };
    const material = new THREE.MeshBasicMaterial(look);
    // Unit shapes that start at the origin and run along y; `fit` gives them their length.
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(SHAFT_RADIUS * size, SHAFT_RADIUS * size, 1, 16), material);
    this.shaft.geometry.translate(0, 0.5, 0);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(HEAD_RADIUS * size, HEAD_LENGTH * size, 24), material);
    this.head.geometry.translate(0, (HEAD_LENGTH * size) / 2, 0);
    for (const part of [this.shaft, this.head]) {
      part.renderOrder = 3;
      part.frustumCulled = false;
      part.onBeforeRender = (_renderer, _scene, camera) => this.fit(camera as THREE.PerspectiveCamera);
    }
    this.group.add(this.shaft, this.head);
    this.group.visible = false;
  }

  /** Starts at the surface of the tool, so that the shortest arrow is seen whole. */
  update(tool: Vec3, toolRadius: number, forceOnDevice: Vec3): void {
    const force = new THREE.Vector3(...forceOnDevice);
    const magnitude = force.length();
    this.length = arrowLength(magnitude, this.maxForce) * this.size;
    this.group.visible = this.length > LENGTH_MIN * this.size;
    if (!this.group.visible) return;
    const direction = force.divideScalar(magnitude);
    this.group.quaternion.setFromUnitVectors(UP, direction);
    this.group.position.set(...tool).addScaledVector(direction, toolRadius);
  }

  /** Shrinks the arrow as a whole where it would reach out of the picture. */
  private fit(camera: THREE.PerspectiveCamera): void {
    const place = this.group.getWorldPosition(new THREE.Vector3()).applyMatrix4(camera.matrixWorldInverse);
    const height = 2 * Math.abs(place.z) * Math.tan(THREE.MathUtils.degToRad(camera.fov) / 2);
    const whole = this.length + HEAD_LENGTH * this.size;
    this.group.scale.setScalar(Math.min(1, (LENGTH_IN_PICTURE * height) / whole));
    this.shaft.scale.y = this.length;
    this.head.position.y = this.length;
    this.group.updateMatrixWorld();
  }
}

/** Length of the arrow over the size of the scene: bounded, however large the force. */
export function arrowLength(force: number, maxForce: number): number {
  return LENGTH_AT_MAX_FORCE * Math.sqrt(Math.min(1, force / maxForce));
}
