// A tool, the patches it touches, the force on its device as an arrow, and a pin where it was left.

import * as THREE from "three";

import type { ContactMessage, SceneMessage, ToolFrame, ToolMessage, Vec3 } from "../net/protocol";
import { deepest } from "../tool_contacts";
import type { BodyView } from "./body_view";
import { closestSurfacePoint } from "./closest_point";
import { ContactRings } from "./contact_rings";
import { ForceArrow } from "./force_arrow";
import { LimitView } from "./limit_view";
import { PinView } from "./pin_view";
import { release } from "./release";
import type { SurfacePoint } from "./surface";
import { originAt } from "./tool_shape";
import type { SurfaceSpot, ToolShape } from "./tool_shape";

/** A contact smaller than this, over the size of the scene, is shown as a ring of this radius all the same. */
const RING_MIN = 0.004;

/** A tool in a frame. */
export interface ToolPose {
  tool: ToolFrame;
  contacts: ContactMessage[];
  pinned: boolean;
}

/** Where a contact sits on its body. */
interface Touched {
  body: number;
  point: Vec3;
  place: SurfacePoint;
}

export class ToolView {
  readonly group = new THREE.Group();
  private readonly solid: THREE.Mesh<THREE.BufferGeometry, THREE.MeshStandardMaterial>;
  private readonly rings = new ContactRings();
  private readonly arrow: ForceArrow;
  private readonly limit: LimitView;
  private readonly pin: PinView;
  private drawnState = "";
  /** Of the current contacts; looked for again where one has slid. */
  private touched: Touched[] = [];

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
    this.arrow = new ForceArrow(size, scene.max_force);
    this.limit = new LimitView(tool.radius);
    this.pin = new PinView();
    this.group.add(this.solid, this.rings.group, this.arrow.group, this.limit.group, this.pin.sprite);
    this.group.visible = false;
  }

  /** Returns whether the picture changes. The rings of contacts move with the bodies: call it after these moved. */
  update(pose: ToolPose): boolean {
    const { tool, pinned } = pose;
    const contacts = pose.contacts.filter(({ body }) => body < this.bodies.length);
    this.touched = contacts.map((contact) => this.find(contact));
    // Of several places, the deepest is the one that the tool is drawn at.
    const contact = deepest(contacts);
    const touched = contact && this.touched[contacts.indexOf(contact)]!;
    const offset = touched ? this.bodies[touched.body]!.exaggerationAt(touched.place).toArray() : [0, 0, 0];
    const state = JSON.stringify([pose, offset]);
    if (state === this.drawnState) return false;
    this.drawnState = state;
    const [w, x, y, z] = tool.orientation;
    this.group.visible = tool.active;
    this.solid.quaternion.set(x, y, z, w);
    const shown = touched && this.shownAt(touched, offset);
    // A tool that slides is held by its force: it is drawn on the surface that gives no farther. One that several places
    // hold is where the server has it: on one of them it would be drawn into the others.
    const held = tool.limited && shown !== null && contact?.depth != null && contacts.length === 1;
    const place = held ? originAt(this.shape, this.solid.quaternion, shown, 0).toArray() : tool.position;
    this.solid.position.set(...place);
    this.limit.update(place, tool.wanted);
    this.pin.sprite.visible = pinned;
    this.pin.sprite.position.set(...place);
    this.arrow.update(this.pressedFrom(place, shown), this.tool.radius, tool.active ? tool.force : [0, 0, 0]);
    // Where displacements are drawn larger than they are, the tool goes with the surface that it touches.
    this.group.position.fromArray(offset);
    const smallest = RING_MIN * this.scene.size;
    this.rings.update(
      this.touched.map((one, i) => ({ ...this.shownAt(one, offset), radius: Math.max(contacts[i]!.radius, smallest) })),
    );
    return true;
  }

  private find({ body, point }: ContactMessage): Touched {
    const known = this.touched.find((one) => one.body === body && samePoint(one.point, point));
    return known ?? { body, point, place: closestSurfacePoint(this.bodies[body]!.surface, point) };
  }

  /** Where a place of the rest surface is drawn, and the normal there, less an offset of the whole tool. */
  private shownAt({ body, place }: Touched, offset: number[]): SurfaceSpot {
    const { surface, placed } = this.bodies[body]!;
    const point = new THREE.Vector3(...surface.at(surface.shown, place)).applyMatrix4(placed.matrix);
    const normal = new THREE.Vector3(...surface.at(surface.shownNormals, place)).normalize();
    return {
      point: point.sub(new THREE.Vector3().fromArray(offset)),
      normal: normal.applyQuaternion(placed.quaternion),
    };
  }

  /** A radius above the place of the tool that presses: of a sphere its centre, of a stylus on its side its middle. */
  private pressedFrom(place: Vec3, shown: SurfaceSpot | null): Vec3 {
    if (!shown) return place;
    const turned = this.solid.quaternion;
    const direction = shown.normal.clone().negate().applyQuaternion(turned.clone().invert());
    const pressing = this.shape.supportPoint(direction).applyQuaternion(turned);
    return pressing.addScaledVector(shown.normal, this.tool.radius).add(new THREE.Vector3(...place)).toArray();
  }

  dispose(): void {
    release(this.group);
  }
}

function samePoint(a: Vec3, b: Vec3): boolean {
  return a[0] === b[0] && a[1] === b[1] && a[2] === b[2];
}
