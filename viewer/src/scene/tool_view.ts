// A tool, the patch it touches, the force on its device as an arrow, and a pin where it was left.

import * as THREE from "three";

import type { ContactMessage, SceneMessage, ToolFrame, ToolMessage, Vec3 } from "../net/protocol";
import type { BodyView } from "./body_view";
import { closestSurfacePoint } from "./closest_point";
import { LimitView } from "./limit_view";
import { PinView } from "./pin_view";
import type { SurfacePoint } from "./surface";

const FORCE_COLOR = 0xffb454;
const RING_COLOR = 0xfff3d6;
/** Length of the arrow at the largest force, over the size of the body; it goes with the root, for a finger's range is wide. */
const ARROW_AT_MAX_FORCE = 0.35;
/** Shorter arrows than this (over the size of the body) are not drawn, N below noise are not either. */
const ARROW_LENGTH_MIN = 0.012;
const UP = new THREE.Vector3(0, 1, 0);
const FORWARD = new THREE.Vector3(0, 0, 1);

/** A tool in a frame. */
export interface ToolPose {
  tool: ToolFrame;
  contact: ContactMessage | null;
  /** Of contacts that begin now, m. */
  contactRadius: number;
  pinned: boolean;
}

export class ToolView {
  readonly group = new THREE.Group();
  private readonly sphere: THREE.Mesh<THREE.SphereGeometry, THREE.MeshStandardMaterial>;
  private readonly ring: THREE.Mesh<THREE.RingGeometry, THREE.MeshBasicMaterial>;
  private readonly arrow = new THREE.Group();
  private readonly shaft: THREE.Mesh<THREE.CylinderGeometry, THREE.MeshBasicMaterial>;
  private readonly head: THREE.Mesh<THREE.ConeGeometry, THREE.MeshBasicMaterial>;
  private readonly limit: LimitView;
  private readonly pin: PinView;
  private drawnState = "";
  /** Where the current contact sits; found once when it begins, for it sticks to the material. */
  private touched: { body: number; point: Vec3; place: SurfacePoint } | null = null;

  constructor(
    private readonly scene: SceneMessage,
    private readonly tool: ToolMessage,
    private readonly bodies: readonly BodyView[],
  ) {
    const { size } = scene;
    this.sphere = new THREE.Mesh(
      new THREE.SphereGeometry(tool.radius, 40, 24),
      new THREE.MeshStandardMaterial({ color: 0xd5dbe3, roughness: 0.28, metalness: 0.15 }),
    );
    this.ring = new THREE.Mesh(
      new THREE.RingGeometry(0.93, 1, 64),
      new THREE.MeshBasicMaterial({
        color: RING_COLOR,
        side: THREE.DoubleSide,
        transparent: true,
        opacity: 0.85,
        depthTest: false,
      }),
    );
    const material = new THREE.MeshBasicMaterial({ color: FORCE_COLOR });
    // Unit shapes that start at the origin and run along y; `update` gives them their length.
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.004 * size, 0.004 * size, 1, 16), material);
    this.shaft.geometry.translate(0, 0.5, 0);
    this.head = new THREE.Mesh(new THREE.ConeGeometry(0.0115 * size, 0.036 * size, 24), material);
    this.arrow.add(this.shaft, this.head);
    this.limit = new LimitView(tool.radius);
    this.pin = new PinView();
    this.group.add(this.sphere, this.ring, this.arrow, this.limit.group, this.pin.sprite);
    this.group.visible = false;
  }

  /** Tells whether the picture changes. The ring of a contact moves with the body: call it after the bodies moved. */
  update(pose: ToolPose): boolean {
    const state = JSON.stringify(pose);
    if (state === this.drawnState) return false;
    this.drawnState = state;
    const { tool, contact, contactRadius, pinned } = pose;
    const [w, x, y, z] = tool.orientation;
    this.group.visible = tool.active;
    this.sphere.position.set(...tool.position);
    this.sphere.quaternion.set(x, y, z, w);
    this.limit.update(tool.position, tool.wanted);
    this.pin.sprite.visible = pinned;
    this.pin.sprite.position.set(...tool.position);
    this.updateRing(contact, contactRadius);
    this.updateArrow(tool);
    return true;
  }

  private updateRing(contact: ContactMessage | null, contactRadius: number): void {
    const body = contact ? this.bodies[contact.body] : undefined;
    this.ring.visible = body !== undefined;
    if (!contact || !body) {
      this.touched = null;
      return;
    }
    const { surface, placed } = body;
    if (this.touched?.body !== contact.body || !samePoint(this.touched.point, contact.point)) {
      this.touched = { body: contact.body, point: contact.point, place: closestSurfacePoint(surface, contact.point) };
    }
    // The contact names its place on the untouched surface; it is drawn where that place has moved to.
    const { place } = this.touched;
    this.ring.position.set(...surface.at(surface.positions, place)).applyMatrix4(placed.matrix);
    const normal = new THREE.Vector3(...surface.at(surface.normals, place)).normalize();
    this.ring.quaternion.setFromUnitVectors(FORWARD, normal.applyQuaternion(placed.quaternion));
    // A point contact has radius zero; it is shown as a small ring all the same.
    this.ring.scale.setScalar(Math.max(contactRadius, 0.008 * this.scene.size));
  }

  private updateArrow({ active, position, force: told }: ToolFrame): void {
    const force = new THREE.Vector3(...told);
    const magnitude = force.length();
    const { size, max_force } = this.scene;
    const length = ARROW_AT_MAX_FORCE * size * Math.sqrt(Math.min(1, magnitude / max_force));
    this.arrow.visible = active && length > ARROW_LENGTH_MIN * size;
    if (!this.arrow.visible) return;
    const direction = force.divideScalar(magnitude);
    this.arrow.quaternion.setFromUnitVectors(UP, direction);
    // Starts at the tool's surface, so that the shortest arrow is seen whole.
    this.arrow.position.set(...position).addScaledVector(direction, this.tool.radius);
    this.shaft.scale.y = length;
    this.head.position.y = length + 0.018 * size;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.limit.dispose();
    this.pin.dispose();
    for (const mesh of [this.sphere, this.ring, this.shaft, this.head]) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
  }
}

function samePoint(a: Vec3, b: Vec3): boolean {
  return a[0] === b[0] && a[1] === b[1] && a[2] === b[2];
}
