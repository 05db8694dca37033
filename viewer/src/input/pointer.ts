// The pointer as a haptic device: on a body it presses, slides or grabs, elsewhere the camera's controls have it.

import * as THREE from "three";

import type { Control } from "../control";
import type { Quaternion, ToolMessage } from "../net/protocol";
import type { Pick } from "../scene/body_view";
import type { Stage } from "../scene/stage";
import type { Viewport } from "../scene/viewport";
import { drivenTool, inControl } from "../store";
import type { State, Store } from "../store";
import type { Place } from "../window_regions";
import { byCamera } from "./hand_over";
import { GrabGesture, PressGesture, orientationOn } from "./press_geometry";
import type { CameraAxes, Gesture, HeldTool, Purpose, SurfaceHit } from "./press_geometry";

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
/** By which the tool turns for each pixel that the pointer goes with Alt. */
const DEGREES_PER_PIXEL = 0.5;
const ALL_PINNED = "All tools are pinned: Escape releases them.";
const INSIDE =
  "No tool reaches the inside that the cut shows: press the surface beside it, turn the body, or end the cut-away.";
const ALL_MOVED = "Every tool is moved by a device: press with it.";

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
  sent: { position: THREE.Vector3; orientation: THREE.Quaternion | null } | null;
}

/** A pointer that is held down, and where. */
export interface PressedPointer {
  down: PointerEvent;
  place: Place;
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
      this.updateDepth();
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
    // Let alone, Alt would lead out of the page to the browser's menu, and the tool would be let go.
    for (const name of ["keydown", "keyup"] as const) {
      window.addEventListener(name, (event) => {
        if (event.key === "Alt" && this.drag) event.preventDefault();
      });
    }
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
    // Without a tool the camera's controls take every drag.
    if (!inControl(state) || state.scene?.tools.length === 0) return;
    if (state.scene?.motion && (event.altKey || state.strike)) {
      // The camera's controls see it too: a drag turns.
      this.aim = event;
      return;
    }
    const place: Place = [event.clientX, event.clientY];
    const pick = this.pick(place);
    if (!pick) {
      // A drag there turns the body all the same.
      if (this.stage.showsInside(this.viewport.rayThrough(...place))) this.control.notice(INSIDE);
      return;
    }
    const tool = drivenTool(state);
    if (tool === null) return this.control.notice(state.pinned.length > 0 ? ALL_PINNED : ALL_MOVED);
    event.stopImmediatePropagation();
    this.begin(event, place, pick, tool, state);
  }

  /** The pointer that presses now, for a scene in which the tool is another one. */
  get held(): PressedPointer | null {
    return this.drag && { down: this.drag.down, place: this.drag.place };
  }

  /** Presses where the pointer is held down, with the tool that a new scene has. */
  pressAgain({ down, place }: PressedPointer): void {
    const state = this.store.get();
    const [pick, tool] = [this.pick(place), drivenTool(state)];
    if (this.drag === null && inControl(state) && pick && tool !== null) this.begin(down, place, pick, tool, state);
  }

  private begin(event: PointerEvent, place: Place, pick: Pick, tool: number, state: State): void {
    const { viewport } = this;
    const { scene, grab: grabWanted, pinned } = state;
    viewport.controls.enabled = false;
    // A press by keys has no pointer that could be caught.
    if (event.isTrusted) viewport.canvas.setPointerCapture(event.pointerId);
    const { size, tools } = scene!;
    // Without another tool a dent that is still seen is the one that this tool has just left.
    const dent = pinned.length > 0 ? pick.dent : 0;
    const sight = this.sight(pick);
    const held = this.heldTool(tool, tools[tool]!, sight.axes);
    const gesture =
      grabWanted || wantsGrab(event)
        ? new GrabGesture(pick.point, sight, size, place, held.orientationOn(pick.normal))
        : new PressGesture({ ...pick, dent }, sight, size, held, {
            pointer: place,
            aim: viewport.project(pick.drawn),
            straight: event.shiftKey,
          });
    const timer = window.setInterval(() => this.advance(), SEND_INTERVAL_MS);
    this.drag = { tool, gesture, down: event, place, movedMs: performance.now(), timer, sent: null };
    if (event.pointerType === "pen") gesture.press(event.pressure);
    this.updateDepth();
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
    const pick = this.pick([event.clientX, event.clientY]);
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
    const [right, down] = [event.clientX - drag.place[0], event.clientY - drag.place[1]];
    drag.place = [event.clientX, event.clientY];
    if (event.pointerType === "pen") drag.gesture.press(event.pressure);
    const purpose = this.purpose(event);
    drag.gesture.moveTo(drag.place, purpose);
    if (purpose === "stay") this.turnTool(drag.tool, right, down);
  }

  private purpose({ altKey, shiftKey, buttons }: PointerEvent): Purpose {
    if (altKey && this.turns(this.drag!.tool) && !this.drag!.gesture.grab) return "stay";
    return shiftKey || (buttons & SECOND_BUTTON) !== 0 ? "deepen" : "slide";
  }

  private turnTool(tool: number, right: number, down: number): void {
    const { tilt, turn } = this.store.get().postures[tool]!;
    this.control.hold({ turn: turn + DEGREES_PER_PIXEL * right, tilt: tilt + DEGREES_PER_PIXEL * down });
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
    const { scene } = this.store.get();
    const able = inControl(this.store.get()) && scene?.tools.length !== 0 && triangles <= HOVER_TRIANGLES_MAX;
    this.viewport.canvas.style.cursor = able && this.pick([event.clientX, event.clientY]) ? this.cursor(event) : "";
  }

  private cursor(event: PointerEvent): string {
    const { strike, grab, scene } = this.store.get();
    if (scene?.motion && (event.altKey || strike)) return "pointer";
    return grab || wantsGrab(event) ? "grab" : "crosshair";
  }

  private handOver({ down, place }: Drag): void {
    this.control.letGo(false);
    this.handedOver = true;
    byCamera(this.viewport.canvas, down, place);
    this.handedOver = false;
  }

  private pick(place: Place): Pick | null {
    return this.stage.pick(this.viewport.rayThrough(...place));
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
    const [position, orientation] = [drag.gesture.position(), drag.gesture.orientation()];
    const { sent } = drag;
    if (sent?.position.equals(position) && (!orientation || sent.orientation?.equals(orientation))) return;
    drag.sent = { position, orientation };
    this.control.press(drag.tool, position.toArray(), drag.gesture.grab, orientation && wxyz(orientation));
  }

  private updateDepth(): void {
    if (!this.drag) return;
    const { tool, gesture } = this.drag;
    this.store.update({ pressing: { tool, grab: gesture.grab, depth: gesture.depth } });
  }

  private heldTool(tool: number, { radius }: ToolMessage, axes: CameraAxes): HeldTool {
    return {
      shape: this.stage.shapes[tool]!,
      radius,
      orientationOn: (normal) => (this.turns(tool) ? orientationOn(normal, axes, this.store.get().postures[tool]!) : null),
    };
  }

  /** Whether it matters how a tool is turned. */
  private turns(tool: number): boolean {
    return this.store.get().scene?.tools[tool]?.shape !== "sphere";
  }

  /** What the pointer meets of a body, as the camera stands. */
  private sight({ body, shown }: Pick): SurfaceHit {
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

function wxyz({ w, x, y, z }: THREE.Quaternion): Quaternion {
  return [w, x, y, z];
}

/** Control, or the command key of a Mac. */
function wantsGrab({ ctrlKey, metaKey }: PointerEvent): boolean {
  return ctrlKey || metaKey;
}
