// A tool, the patch it touches, the force on its device as an arrow, and a pin where it was left.

import * as THREE from "three";

import type { ContactMessage, SceneMessage, ToolFrame, ToolMessage, Vec3 } from "../net/protocol";
import type { BodyView } from "./body_view";
import { closestSurfacePoint } from "./closest_point";
import { ForceArrow } from "./force_arrow";
import { LimitView } from "./limit_view";
import { PinView } from "./pin_view";
import type { SurfacePoint } from "./surface";
import { originAt } from "./tool_shape";
import type { SurfaceSpot, ToolShape } from "./tool_shape";

const RING_COLOR = 0xfff3d6;
/** A contact smaller than this, over the size of the scene, is shown as a ring of this radius all the same. */
const RING_MIN = 0.004;
const FORWARD = new THREE.Vector3(0, 0, 1);

/** A tool in a frame. */
export interface ToolPose {
  tool: ToolFrame;
  contact: ContactMessage | null;
  pinned: boolean;
}

export class ToolView {
  readonly group = new THREE.Group();
  private readonly solid: THREE.Mesh<THREE.BufferGeometry, THREE.MeshStandardMaterial>;
  private readonly ring: THREE.Mesh<THREE.RingGeometry, THREE.MeshBasicMaterial>;
  private readonly arrow: ForceArrow;
  private readonly limit: LimitView;
  private readonly pin: PinView;
  private drawnState = "";
  /** Where the current contact sits; looked for again where it has slid. */
  private touched: { body: number; point: Vec3; place: SurfacePoint } | null = null;

  constructor(
    private readonly scene: SceneMessage,
    private readonly tool: ToolMessage,
    private readonly shape: ToolShape,
    private readonly bodies: readonly BodyView[],
  ) {
    const { size } = scene;
    this.solid = new THREE.Mesh(
      shape.geometry(),
      // Of glass, so that the dent below it is seen.
      new THREE.MeshStandardMaterial({ color: 0xd5dbe3, roughness: 0.28, metalness: 0.15, transparent: true, opacity: 0.5 }),
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
    this.arrow = new ForceArrow(size, scene.max_force);
    this.limit = new LimitView(tool.radius);
    this.pin = new PinView();
    this.group.add(this.solid, this.ring, this.arrow.group, this.limit.group, this.pin.sprite);
    this.group.visible = false;
  }

  /** Tells whether the picture changes. The ring of a contact moves with the body: call it after the bodies moved. */
  update(pose: ToolPose): boolean {
    const { tool, contact, pinned } = pose;
    const touched = this.find(contact);
    const offset = touched ? touched.body.exaggerationAt(touched.place).toArray() : [0, 0, 0];
    const state = JSON.stringify([pose, offset]);
    if (state === this.drawnState) return false;
    this.drawnState = state;
    const [w, x, y, z] = tool.orientation;
    this.group.visible = tool.active;
    this.solid.quaternion.set(x, y, z, w);
    const shown = touched && shownAt(touched, offset);
    // A tool that slides is held by its force: it is drawn on the surface that gives no farther.
    const held = tool.limited && shown !== null && contact?.depth != null;
    const place = held ? originAt(this.shape, this.solid.quaternion, shown, 0).toArray() : tool.position;
    this.solid.position.set(...place);
    this.limit.update(place, tool.wanted);
    this.pin.sprite.visible = pinned;
    this.pin.sprite.position.set(...place);
    this.arrow.update(this.pressedFrom(place, shown), this.tool.radius, tool.active ? tool.force : [0, 0, 0]);
    // Where displacements are drawn larger than they are, the tool goes with the surface that it touches.
    this.group.position.fromArray(offset);
    this.ring.visible = shown !== null;
    if (contact && shown) this.drawRing(contact, shown);
    return true;
  }

  private find(contact: ContactMessage | null): { body: BodyView; place: SurfacePoint } | null {
    const body = contact ? this.bodies[contact.body] : undefined;
    if (!contact || !body) {
      this.touched = null;
      return null;
    }
    if (this.touched?.body !== contact.body || !samePoint(this.touched.point, contact.point)) {
      this.touched = { body: contact.body, point: contact.point, place: closestSurfacePoint(body.surface, contact.point) };
    }
    return { body, place: this.touched.place };
  }

  /** A radius above the place of the tool that presses: of a sphere its centre, of a stylus on its side its middle. */
  private pressedFrom(place: Vec3, shown: SurfaceSpot | null): Vec3 {
    if (!shown) return place;
    const turned = this.solid.quaternion;
    const direction = shown.normal.clone().negate().applyQuaternion(turned.clone().invert());
    const pressing = this.shape.footing(direction).applyQuaternion(turned);
    return pressing.addScaledVector(shown.normal, this.tool.radius).add(new THREE.Vector3(...place)).toArray();
  }

  private drawRing(contact: ContactMessage, { point, normal }: SurfaceSpot): void {
    this.ring.position.copy(point);
    this.ring.quaternion.setFromUnitVectors(FORWARD, normal);
    this.ring.scale.setScalar(Math.max(contact.radius, RING_MIN * this.scene.size));
  }

  dispose(): void {
    this.group.removeFromParent();
    this.limit.dispose();
    this.pin.dispose();
    this.arrow.dispose();
    for (const mesh of [this.solid, this.ring]) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
  }
}

/** Where a place of the rest surface is drawn, and the normal there, less an offset of the whole tool. */
function shownAt(
  { body, place }: { body: BodyView; place: SurfacePoint },
  offset: number[],
): SurfaceSpot {
  const { surface, placed } = body;
  const point = new THREE.Vector3(...surface.at(surface.shown, place)).applyMatrix4(placed.matrix);
  const normal = new THREE.Vector3(...surface.at(surface.shownNormals, place)).normalize();
  return {
    point: point.sub(new THREE.Vector3().fromArray(offset)),
    normal: normal.applyQuaternion(placed.quaternion),
  };
}

function samePoint(a: Vec3, b: Vec3): boolean {
  return a[0] === b[0] && a[1] === b[1] && a[2] === b[2];
}
