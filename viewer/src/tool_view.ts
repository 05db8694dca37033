// The tool, the patch it touches, and the force on the device as an arrow.

import * as THREE from "three";

import { closestSurfacePoint } from "./closest_point";
import { HoldView } from "./hold_view";
import type { ContactMessage, FrameMessage, SceneMessage, Vec3 } from "./protocol";
import type { Surface, SurfacePoint } from "./surface";

const FORCE_COLOR = 0xffb454;
const RING_COLOR = 0xfff3d6;
/** Length of the arrow at the largest force, over the size of the body; it goes with the root, for a finger's range is wide. */
const ARROW_AT_MAX_FORCE = 0.35;
/** Shorter arrows than this (over the size of the body) are not drawn, N below noise are not either. */
const ARROW_LENGTH_MIN = 0.012;
const UP = new THREE.Vector3(0, 1, 0);
const FORWARD = new THREE.Vector3(0, 0, 1);

export class ToolView {
  readonly group = new THREE.Group();
  contactRadius: number;
  private readonly sphere: THREE.Mesh<THREE.SphereGeometry, THREE.MeshStandardMaterial>;
  private readonly ring: THREE.Mesh<THREE.RingGeometry, THREE.MeshBasicMaterial>;
  private readonly arrow = new THREE.Group();
  private readonly shaft: THREE.Mesh<THREE.CylinderGeometry, THREE.MeshBasicMaterial>;
  private readonly head: THREE.Mesh<THREE.ConeGeometry, THREE.MeshBasicMaterial>;
  private readonly hold: HoldView;
  private drawnState = "";
  /** Where the current contact sits; found once when it begins, for it sticks to the material. */
  private touched: { point: Vec3; place: SurfacePoint } | null = null;

  constructor(private readonly header: SceneMessage, private readonly surface: Surface) {
    const { size, tool_radius } = header;
    this.contactRadius = header.contact_radius;
    this.sphere = new THREE.Mesh(
      new THREE.SphereGeometry(tool_radius, 40, 24),
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
    this.hold = new HoldView(tool_radius);
    this.group.add(this.sphere, this.ring, this.arrow, this.hold.group);
    this.group.visible = false;
  }

  /** Tells whether the picture changes. */
  update(frame: FrameMessage): boolean {
    const state = JSON.stringify([frame.tool, frame.force, frame.contacts]);
    if (state === this.drawnState) return false;
    this.drawnState = state;
    this.group.visible = frame.tool.active;
    this.sphere.position.set(...frame.tool.position);
    this.hold.update(frame.tool.position, frame.tool.wanted);
    this.updateRing(frame.contacts[0]);
    this.updateArrow(frame);
    return true;
  }

  private updateRing(contact: ContactMessage | undefined): void {
    this.ring.visible = contact !== undefined;
    if (!contact) {
      this.touched = null;
      return;
    }
    if (!this.touched || !samePoint(this.touched.point, contact.point)) {
      this.touched = { point: contact.point, place: closestSurfacePoint(this.surface, contact.point) };
    }
    // The contact names its place on the untouched surface; it is drawn where that place has moved to.
    const { place } = this.touched;
    this.ring.position.set(...this.surface.at(this.surface.positions, place));
    const normal = new THREE.Vector3(...this.surface.at(this.surface.normals, place)).normalize();
    this.ring.quaternion.setFromUnitVectors(FORWARD, normal);
    // A point contact has radius zero; it is shown as a small ring all the same.
    this.ring.scale.setScalar(Math.max(this.contactRadius, 0.008 * this.header.size));
  }

  private updateArrow(frame: FrameMessage): void {
    const force = new THREE.Vector3(...frame.force);
    const magnitude = force.length();
    const { size, max_force } = this.header;
    const length = ARROW_AT_MAX_FORCE * size * Math.sqrt(Math.min(1, magnitude / max_force));
    this.arrow.visible = frame.tool.active && length > ARROW_LENGTH_MIN * size;
    if (!this.arrow.visible) return;
    const direction = force.divideScalar(magnitude);
    this.arrow.quaternion.setFromUnitVectors(UP, direction);
    // Starts at the tool's surface, so that the shortest arrow is seen whole.
    this.arrow.position.set(...frame.tool.position).addScaledVector(direction, this.header.tool_radius);
    this.shaft.scale.y = length;
    this.head.position.y = length + 0.018 * size;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.hold.dispose();
    for (const mesh of [this.sphere, this.ring, this.shaft, this.head]) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
  }
}

function samePoint(a: Vec3, b: Vec3): boolean {
  return a[0] === b[0] && a[1] === b[1] && a[2] === b[2];
}
