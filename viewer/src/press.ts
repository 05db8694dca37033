// The pointer as a haptic device: on the body it presses or grabs, elsewhere the camera's controls have it.

import * as THREE from "three";

import type { BodyView, Pick } from "./body_view";
import { GrabGesture, PressGesture } from "./press_geometry";
import type { CameraAxes, Gesture } from "./press_geometry";
import type { Vec3 } from "./protocol";
import { RateLimit } from "./rate_limit";
import type { Viewport } from "./viewport";

/** The server takes 250 messages a second; a mouse may report 1000. */
const SEND_INTERVAL_MS = 4;
/** One notch of a wheel is 100 pixels; it moves the tool by this share of the size of the body. */
const WHEEL_STEP = 0.002;
const WHEEL_NOTCH_PX = 100;
/** A click may slip so far; more is a drag. */
const CLICK_PX = 8;
/** Larger bodies are not searched under every hovering pointer, it would slow the page. */
const HOVER_TRIANGLES_MAX = 30_000;

export interface PressHandlers {
  /** Whether this page may press, and on what. */
  body(): BodyView | null;
  grabWanted(): boolean;
  /** Whether a click strikes, as it does with Alt. */
  strikeWanted(): boolean;
  onStrike(pick: Pick): void;
  onPress(centre: Vec3, grab: boolean): void;
  onRelease(): void;
}

export class Press {
  /** Movements of the pointer taken in while pressing. */
  pointerEvents = 0;
  private gesture: Gesture | null = null;
  private down: PointerEvent | null = null;
  private last = { x: 0, y: 0, metresPerPixel: 0 };
  private size = 1;
  private readonly limit = new RateLimit(SEND_INTERVAL_MS, () => this.send());
  private handedOver = false;
  /** Where a click began that strikes if the pointer does not move. */
  private aim: PointerEvent | null = null;

  constructor(private readonly viewport: Viewport, private readonly handlers: PressHandlers) {
    const { canvas } = viewport;
    // Before the camera's controls, which listen on the same element, get to see it.
    canvas.addEventListener("pointerdown", (event) => this.onDown(event), { capture: true });
    // Raw updates come as soon as the mouse reports, not once for each drawn frame.
    const moved = "onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove";
    canvas.addEventListener(moved, (event) => this.onMove(event as PointerEvent));
    canvas.addEventListener("pointermove", (event) => this.onHover(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(name, (event) => {
        if (event.pointerId === this.down?.pointerId) this.release();
        if (event.pointerId === this.aim?.pointerId) this.finishAim(event);
      });
    }
    canvas.addEventListener("wheel", (event) => this.onWheel(event), { capture: true, passive: false });
    window.addEventListener("blur", () => this.release());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.release();
    });
  }

  get active(): boolean {
    return this.gesture !== null;
  }

  get grabbing(): boolean {
    return this.gesture?.grab ?? false;
  }

  /** Depth of the press or length of the pull with the tool at a place, or where the pointer wants it, m. */
  depthOf(tool: Vec3 | null): number | null {
    if (!this.gesture) return null;
    return this.gesture.depthOf(tool ? new THREE.Vector3(...tool) : this.gesture.centre());
  }

  release(): void {
    if (!this.gesture) return;
    this.limit.cancel();
    this.gesture = null;
    const pointerId = this.down?.pointerId;
    this.down = null;
    this.viewport.controls.enabled = true;
    const { canvas } = this.viewport;
    if (pointerId !== undefined && canvas.hasPointerCapture(pointerId)) canvas.releasePointerCapture(pointerId);
    this.handlers.onRelease();
  }

  private onDown(event: PointerEvent): void {
    // A second finger means the camera.
    this.aim = null;
    if (this.handedOver) return;
    if (this.gesture) {
      if (event.pointerType === "touch" && this.down?.pointerType === "touch") this.handOver(this.down);
      else event.stopImmediatePropagation();
      return;
    }
    // A second finger while the first one orbits belongs to the camera.
    if (event.button !== 0 || event.ctrlKey || event.metaKey || !event.isPrimary) return;
    const body = this.handlers.body();
    if (body?.data.header.motion && (event.altKey || this.handlers.strikeWanted())) {
      // The camera's controls see it too: a drag turns.
      this.aim = event;
      return;
    }
    const pick = body?.pick(this.viewport.rayThrough(event.clientX, event.clientY));
    if (!body || !pick) return;
    event.stopImmediatePropagation();
    this.viewport.controls.enabled = false;
    this.viewport.canvas.setPointerCapture(event.pointerId);
    const { header } = body.data;
    this.down = event;
    this.size = header.size;
    const metresPerPixel = this.viewport.metresPerPixel(pick.shown);
    this.last = { x: event.clientX, y: event.clientY, metresPerPixel };
    const grab = event.shiftKey || this.handlers.grabWanted();
    this.gesture = grab
      ? new GrabGesture(pick, this.cameraAxes(), header.size)
      : new PressGesture(pick, this.cameraAxes(), header.size, header.tool_radius);
    this.limit.request();
  }

  private finishAim(event: PointerEvent): void {
    const { aim } = this;
    this.aim = null;
    if (!aim || event.type !== "pointerup") return;
    if (Math.hypot(event.clientX - aim.clientX, event.clientY - aim.clientY) > CLICK_PX) return;
    const pick = this.handlers.body()?.pick(this.viewport.rayThrough(event.clientX, event.clientY));
    if (pick) this.handlers.onStrike(pick);
  }

  private onMove(event: PointerEvent): void {
    if (!this.gesture || event.pointerId !== this.down?.pointerId) return;
    this.pointerEvents += 1;
    const { x, y, metresPerPixel } = this.last;
    this.gesture.move((event.clientX - x) * metresPerPixel, (event.clientY - y) * metresPerPixel);
    this.last.x = event.clientX;
    this.last.y = event.clientY;
    this.limit.request();
  }

  private onWheel(event: WheelEvent): void {
    if (!this.gesture) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    // Lines and pages, which some browsers report, are about a notch each.
    const notches = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / WHEEL_NOTCH_PX : event.deltaY / 3;
    this.gesture.wheel(notches * WHEEL_STEP * this.size);
    this.limit.request();
  }

  private onHover(event: PointerEvent): void {
    if (event.pointerType === "touch" || event.buttons !== 0) return;
    const body = this.handlers.body();
    const small = body !== null && body.surface.triangles.length / 3 <= HOVER_TRIANGLES_MAX;
    const over = small && body.pick(this.viewport.rayThrough(event.clientX, event.clientY)) !== null;
    this.viewport.canvas.style.cursor = over ? this.cursor(event) : "";
  }

  private cursor(event: PointerEvent): string {
    if (event.altKey || this.handlers.strikeWanted()) return "pointer";
    return event.shiftKey || this.handlers.grabWanted() ? "grab" : "crosshair";
  }

  /** Two fingers are for the camera: it is told of the first one, which it never saw, before it sees the second. */
  private handOver(first: PointerEvent): void {
    const { x, y } = this.last;
    this.release();
    this.handedOver = true;
    const { pointerId, pointerType } = first;
    const again = { pointerId, pointerType, clientX: x, clientY: y, isPrimary: true, bubbles: true, button: 0 };
    this.viewport.canvas.dispatchEvent(new PointerEvent("pointerdown", again));
    this.handedOver = false;
  }

  private send(): void {
    if (this.gesture) this.handlers.onPress(this.gesture.centre().toArray(), this.gesture.grab);
  }

  private cameraAxes(): CameraAxes {
    const [right, up, backward] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    this.viewport.camera.updateMatrixWorld();
    this.viewport.camera.matrixWorld.extractBasis(right, up, backward);
    return { right, up, forward: backward.negate() };
  }
}
