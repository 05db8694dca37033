// The pointer as a haptic device: on a body it presses or grabs, elsewhere the camera's controls have it.

import * as THREE from "three";

import type { Control } from "../control";
import { RateLimit } from "../net/rate_limit";
import type { Pick } from "../scene/body_view";
import type { Stage } from "../scene/stage";
import type { Viewport } from "../scene/viewport";
import { drivenTool, inControl } from "../store";
import type { State, Store } from "../store";
import { GrabGesture, PressGesture } from "./press_geometry";
import type { CameraAxes, Gesture } from "./press_geometry";

/** The server takes 250 messages a second; a mouse may report 1000. */
const SEND_INTERVAL_MS = 4;
/** One notch of a wheel is 100 pixels; it moves the tool by this share of the size of the scene. */
const WHEEL_STEP = 0.002;
const WHEEL_NOTCH_PX = 100;
/** A click may slip so far; more is a drag. */
const CLICK_PX = 8;
/** Larger bodies are not searched under every hovering pointer, it would slow the page. */
const HOVER_TRIANGLES_MAX = 30_000;
const ALL_PINNED = "All tools are pinned: Escape lets them go.";

/** What one pointer does from when it goes down on a body. */
interface Drag {
  tool: number;
  gesture: Gesture;
  down: PointerEvent;
  /** m. */
  metresPerPixel: number;
  x: number;
  y: number;
}

export class Pointer {
  /** Movements of the pointer taken in while pressing. */
  events = 0;
  private drag: Drag | null = null;
  private readonly viewport: Viewport;
  private readonly limit = new RateLimit(SEND_INTERVAL_MS, () => this.send());
  private handedOver = false;
  /** Where a click began that strikes if the pointer does not move. */
  private aim: PointerEvent | null = null;

  constructor(private readonly stage: Stage, private readonly store: Store, private readonly control: Control) {
    this.viewport = stage.viewport;
    this.listen();
    store.subscribe(["pressing"], ({ pressing }) => {
      if (!pressing) this.drop();
    });
    store.subscribe(["frame"], () => this.tellDepth());
  }

  /** Depth of the press or length of the pull where the pointer wants it, m. */
  get wantedDepth(): number | null {
    return this.drag && this.drag.gesture.depthOf(this.drag.gesture.centre());
  }

  private listen(): void {
    const { canvas } = this.viewport;
    // Before the camera's controls, which listen on the same element, get to see it.
    canvas.addEventListener("pointerdown", (event) => this.onDown(event), { capture: true });
    // Raw updates come as soon as the mouse reports, not once for each drawn frame.
    const moved = "onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove";
    canvas.addEventListener(moved, (event) => this.onMove(event as PointerEvent));
    canvas.addEventListener("pointermove", (event) => this.onHover(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(name, (event) => {
        if (event.pointerId === this.drag?.down.pointerId) this.control.letGo(name === "pointerup");
        if (event.pointerId === this.aim?.pointerId) this.finishAim(event);
      });
    }
    canvas.addEventListener("wheel", (event) => this.onWheel(event), { capture: true, passive: false });
    window.addEventListener("blur", () => this.control.letGo(false));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.control.letGo(false);
    });
  }

  private onDown(event: PointerEvent): void {
    // A second finger means the camera.
    this.aim = null;
    if (this.handedOver) return;
    if (this.drag) {
      if (event.pointerType === "touch" && this.drag.down.pointerType === "touch") this.handOver(this.drag);
      else event.stopImmediatePropagation();
      return;
    }
    // A second finger while the first one orbits belongs to the camera.
    if (event.button !== 0 || event.ctrlKey || event.metaKey || !event.isPrimary) return;
    const state = this.store.get();
    if (!inControl(state)) return;
    if (state.scene?.motion && (event.altKey || state.strike)) {
      // The camera's controls see it too: a drag turns.
      this.aim = event;
      return;
    }
    const pick = this.pick(event);
    if (!pick) return;
    const tool = drivenTool(state);
    if (tool === null) return this.control.notice(ALL_PINNED);
    this.begin(event, pick, tool, state);
  }

  private begin(event: PointerEvent, pick: Pick, tool: number, { scene, grab: grabWanted }: State): void {
    const { viewport } = this;
    event.stopImmediatePropagation();
    viewport.controls.enabled = false;
    viewport.canvas.setPointerCapture(event.pointerId);
    const grab = event.shiftKey || grabWanted;
    const { size, tools } = scene!;
    const gesture = grab
      ? new GrabGesture(pick, this.cameraAxes(), size)
      : new PressGesture(pick, this.cameraAxes(), size, tools[tool]!.radius);
    const metresPerPixel = viewport.metresPerPixel(pick.shown);
    this.drag = { tool, gesture, down: event, metresPerPixel, x: event.clientX, y: event.clientY };
    this.tellDepth();
    this.limit.request();
  }

  /** Gives the pointer back to the camera. */
  private drop(): void {
    if (!this.drag) return;
    const { pointerId } = this.drag.down;
    this.drag = null;
    this.limit.cancel();
    this.viewport.controls.enabled = true;
    const { canvas } = this.viewport;
    if (canvas.hasPointerCapture(pointerId)) canvas.releasePointerCapture(pointerId);
  }

  private finishAim(event: PointerEvent): void {
    const { aim } = this;
    this.aim = null;
    if (!aim || event.type !== "pointerup") return;
    if (Math.hypot(event.clientX - aim.clientX, event.clientY - aim.clientY) > CLICK_PX) return;
    const pick = this.pick(event);
    if (!pick || pick.body !== this.store.get().scene?.motion?.body) return;
    const { settled, normal } = pick.inBody;
    const [x, y, z] = normal;
    this.control.strikeAt(pick.body, settled, [-x, -y, -z]);
  }

  private onMove(event: PointerEvent): void {
    const { drag } = this;
    if (!drag || event.pointerId !== drag.down.pointerId) return;
    this.events += 1;
    const { x, y, metresPerPixel } = drag;
    drag.gesture.move((event.clientX - x) * metresPerPixel, (event.clientY - y) * metresPerPixel);
    drag.x = event.clientX;
    drag.y = event.clientY;
    this.limit.request();
  }

  private onWheel(event: WheelEvent): void {
    if (!this.drag) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    // Lines and pages, which some browsers report, are about a notch each.
    const notches = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / WHEEL_NOTCH_PX : event.deltaY / 3;
    this.drag.gesture.wheel(notches * WHEEL_STEP * (this.store.get().scene?.size ?? 0));
    this.limit.request();
  }

  private onHover(event: PointerEvent): void {
    if (event.pointerType === "touch" || event.buttons !== 0) return;
    const triangles = this.stage.bodies.reduce((sum, { surface }) => sum + surface.triangles.length / 3, 0);
    const able = inControl(this.store.get()) && triangles <= HOVER_TRIANGLES_MAX;
    this.viewport.canvas.style.cursor = able && this.pick(event) ? this.cursor(event) : "";
  }

  private cursor(event: PointerEvent): string {
    const { strike, grab, scene } = this.store.get();
    if (scene?.motion && (event.altKey || strike)) return "pointer";
    return event.shiftKey || grab ? "grab" : "crosshair";
  }

  /** Two fingers are for the camera: it is told of the first one, which it never saw, before it sees the second. */
  private handOver({ down, x, y }: Drag): void {
    this.control.letGo(false);
    this.handedOver = true;
    const { pointerId, pointerType } = down;
    const again = { pointerId, pointerType, clientX: x, clientY: y, isPrimary: true, bubbles: true, button: 0 };
    this.viewport.canvas.dispatchEvent(new PointerEvent("pointerdown", again));
    this.handedOver = false;
  }

  private pick(event: PointerEvent): Pick | null {
    return this.stage.pick(this.viewport.rayThrough(event.clientX, event.clientY));
  }

  private send(): void {
    if (this.drag) this.control.press(this.drag.tool, this.drag.gesture.centre().toArray(), this.drag.gesture.grab);
  }

  /** While the tool is limited, its own depth is told, not that of the pointer. */
  private tellDepth(): void {
    if (!this.drag) return;
    const { tool, gesture } = this.drag;
    const driven = this.store.get().frame?.tools[tool];
    const place = driven?.limited ? new THREE.Vector3(...driven.position) : gesture.centre();
    this.store.update({ pressing: { tool, grab: gesture.grab, depth: gesture.depthOf(place) } });
  }

  private cameraAxes(): CameraAxes {
    const [right, up, backward] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    this.viewport.camera.updateMatrixWorld();
    this.viewport.camera.matrixWorld.extractBasis(right, up, backward);
    return { right, up, forward: backward.negate() };
  }
}
