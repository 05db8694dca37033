// The pointer as a haptic device: on a body it presses, slides or grabs, elsewhere the camera's controls have it.

import * as THREE from "three";

import type { Control } from "../control";
import type { Pick } from "../scene/body_view";
import type { Stage } from "../scene/stage";
import type { Viewport } from "../scene/viewport";
import { drivenTool, inControl } from "../store";
import type { State, Store } from "../store";
import { GrabGesture, PressGesture } from "./press_geometry";
import type { CameraAxes, Gesture, Place, Sight } from "./press_geometry";

/** So often the tool is told where to go while it moves; a mouse may report four times as often. */
const SEND_INTERVAL_MS = 4;
/** After a pause of the page, which may be long, time goes on as if it had been so short, s. */
const STEP_MAX_S = 0.05;
const WHEEL_NOTCH_PX = 100;
/** Bits of mouse buttons among those that are held. */
const FIRST_BUTTON = 1;
const SECOND_BUTTON = 2;
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
  place: Place;
  /** When the gesture was last let move on, ms, and the timer that does. */
  movedMs: number;
  timer: number;
  /** What was sent last. */
  sent: THREE.Vector3 | null;
}

export class Pointer {
  /** Movements of the pointer taken in while pressing. */
  events = 0;
  private drag: Drag | null = null;
  private readonly viewport: Viewport;
  private handedOver = false;
  /** Where a click began that strikes if the pointer does not move. */
  private aim: PointerEvent | null = null;

  constructor(private readonly stage: Stage, private readonly store: Store, private readonly control: Control) {
    this.viewport = stage.viewport;
    this.listen();
    store.subscribe(["pressing"], ({ pressing }) => {
      if (!pressing) this.drop();
    });
    store.subscribe(["frame"], ({ frame }) => {
      if (this.drag) this.drag.gesture.hold(frame?.tools[this.drag.tool]?.limited ?? false);
      this.tellDepth();
    });
    // Another place of the tool for the same place of the pointer: the surface is drawn elsewhere.
    store.subscribe(["shownScale"], () => control.letGo(false));
  }

  /** Depth of the press or length of the pull where the pointer wants it, m. */
  get wantedDepth(): number | null {
    return this.drag && this.drag.gesture.depth;
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
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
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
    if (event.button !== 0 || !event.isPrimary) return;
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

  private begin(event: PointerEvent, pick: Pick, tool: number, { scene, grab: grabWanted, pinned }: State): void {
    const { viewport } = this;
    event.stopImmediatePropagation();
    viewport.controls.enabled = false;
    viewport.canvas.setPointerCapture(event.pointerId);
    const { size, tools } = scene!;
    const place: Place = [event.clientX, event.clientY];
    // Without another tool a dent that is still seen is the one that this tool has just left.
    const dent = pinned.length > 0 ? pick.dent : 0;
    const gesture =
      grabWanted || wantsGrab(event)
        ? new GrabGesture(pick.point, this.sight(pick), size, place)
        : new PressGesture({ ...pick, dent }, this.sight(pick), size, tools[tool]!.radius, {
            pointer: place,
            aim: viewport.project(pick.drawn),
            straight: event.shiftKey,
          });
    const timer = window.setInterval(() => this.advance(), SEND_INTERVAL_MS);
    this.drag = { tool, gesture, down: event, place, movedMs: performance.now(), timer, sent: null };
    if (event.pointerType === "pen") gesture.press(event.pressure);
    this.tellDepth();
    this.send(this.drag);
  }

  /** Gives the pointer back to the camera. */
  private drop(): void {
    if (!this.drag) return;
    const { down, timer } = this.drag;
    this.drag = null;
    window.clearInterval(timer);
    this.viewport.controls.enabled = true;
    const { canvas } = this.viewport;
    if (canvas.hasPointerCapture(down.pointerId)) canvas.releasePointerCapture(down.pointerId);
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
    // The first button was let go before the second one.
    if ((event.buttons & FIRST_BUTTON) === 0) return this.control.letGo(true);
    drag.place = [event.clientX, event.clientY];
    if (event.pointerType === "pen") drag.gesture.press(event.pressure);
    drag.gesture.moveTo(drag.place, event.shiftKey || (event.buttons & SECOND_BUTTON) !== 0);
  }

  private onWheel(event: WheelEvent): void {
    if (!this.drag) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    // Lines and pages, which some browsers report, are about a notch each. With Shift a wheel scrolls sideways.
    const turned = event.deltaY || event.deltaX;
    this.drag.gesture.wheel(event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? turned / WHEEL_NOTCH_PX : turned / 3);
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
    return grab || wantsGrab(event) ? "grab" : "crosshair";
  }

  /** Two fingers are for the camera: it is told of the first one, which it never saw, before it sees the second. */
  private handOver({ down, place: [clientX, clientY] }: Drag): void {
    this.control.letGo(false);
    this.handedOver = true;
    const { pointerId, pointerType } = down;
    const again = { pointerId, pointerType, clientX, clientY, isPrimary: true, bubbles: true, button: 0 };
    this.viewport.canvas.dispatchEvent(new PointerEvent("pointerdown", again));
    this.handedOver = false;
  }

  private pick(event: PointerEvent): Pick | null {
    return this.stage.pick(this.viewport.rayThrough(event.clientX, event.clientY));
  }

  /** Lets the tool go on towards what the pointer wants. */
  private advance(): void {
    const { drag } = this;
    if (!drag) return;
    const nowMs = performance.now();
    drag.gesture.advance(Math.min((nowMs - drag.movedMs) / 1000, STEP_MAX_S));
    drag.movedMs = nowMs;
    this.send(drag);
  }

  private send(drag: Drag): void {
    const centre = drag.gesture.centre();
    if (drag.sent?.equals(centre)) return;
    drag.sent = centre;
    this.control.press(drag.tool, centre.toArray(), drag.gesture.grab);
  }

  private tellDepth(): void {
    if (!this.drag) return;
    const { tool, gesture } = this.drag;
    this.store.update({ pressing: { tool, grab: gesture.grab, depth: gesture.depth } });
  }

  /** What the pointer meets of a body, as the camera stands. */
  private sight({ body, shown }: Pick): Sight {
    const { viewport, stage } = this;
    return {
      axes: this.cameraAxes(),
      metresPerPixel: viewport.metresPerPixel(shown),
      surfaceAt: ([x, y]) => stage.bodies[body]?.untouchedAlong(viewport.rayThrough(x, y)) ?? null,
    };
  }

  private cameraAxes(): CameraAxes {
    const [right, up, backward] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    this.viewport.camera.updateMatrixWorld();
    this.viewport.camera.matrixWorld.extractBasis(right, up, backward);
    return { right, up, forward: backward.negate() };
  }
}

/** Control, or the command key of a Mac. */
function wantsGrab({ ctrlKey, metaKey }: PointerEvent): boolean {
  return ctrlKey || metaKey;
}
