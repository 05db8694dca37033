// The picture by keys, for hands without a pointer: while it has the focus, Space presses what is in its middle, arrows slide
// the tool or turn the picture. The keys make the same events as a mouse, so that a press is the same press.

import type { Viewport } from "../scene/viewport";
import { inControl } from "../store";
import type { Store } from "../store";
import type { Place } from "../window_regions";

/** No pointer of the browser has this number. */
const POINTER_ID = -7;
/** One stroke of a key slides so far, CSS pixels, turns by so much, degrees, and zooms by this factor. */
const SLIDE_PX = 6;
const TURN_DEG = 8;
const ZOOM = 1.15;
/** As one notch of a mouse wheel reports, pixels. */
const NOTCH_PX = 100;

const NOTHING_THERE = "Nothing can be pressed in the middle of the picture: turn it with the arrows, or press v.";

/** To the right and up. */
const ARROWS: Record<string, readonly [right: number, up: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

export class PictureKeys {
  private place: Place = [0, 0];

  constructor(private readonly viewport: Viewport, private readonly store: Store, private readonly notice: (text: string) => void) {
    viewport.canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !this.take(event.key, event.repeat)) return;
      event.preventDefault();
      event.stopPropagation();
    });
    // A pointer needs no focus here, and a letter after a press would draw a ring around the picture. What is typed ends.
    viewport.canvas.addEventListener("mousedown", (event) => {
      event.preventDefault();
      if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
    });
    viewport.canvas.addEventListener("blur", () => {
      if (this.pressing) this.point("pointerup", 0);
    });
  }

  private get pressing(): boolean {
    return this.store.get().pressing !== null;
  }

  /** Does what a key is for, and returns whether there is anything. */
  private take(key: string, repeated: boolean): boolean {
    const arrow = ARROWS[key];
    if (arrow) this.go(...arrow);
    else if (key === "PageDown" || key === "PageUp") this.deepen(key === "PageDown" ? 1 : -1);
    else if (key === "+" || key === "-") this.viewport.zoom(key === "+" ? ZOOM : 1 / ZOOM);
    else if (key === " " && this.mayPress()) {
      if (!repeated) this.togglePress();
    } else return false;
    return true;
  }

  private mayPress(): boolean {
    const state = this.store.get();
    return inControl(state) && !state.frame?.replay && (state.scene?.tools.length ?? 0) > 0;
  }

  private togglePress(): void {
    if (this.pressing) return this.point("pointerup", 0);
    const { viewport, store } = this;
    this.place = viewport.project(viewport.controls.target.clone());
    // The camera's controls would try to catch a pointer that does not exist.
    viewport.controls.enabled = false;
    this.point("pointerdown", 1);
    if (this.pressing) return;
    // What was struck is struck as the key goes down; a press has disabled the controls by itself.
    this.point("pointerup", 0);
    viewport.controls.enabled = true;
    if (!store.get().strike) this.notice(NOTHING_THERE);
  }

  private go(right: number, up: number): void {
    if (!this.pressing) return this.viewport.turn(TURN_DEG * right, TURN_DEG * up);
    this.place = [this.place[0] + SLIDE_PX * right, this.place[1] - SLIDE_PX * up];
    this.point("onpointerrawupdate" in window ? "pointerrawupdate" : "pointermove", 1);
  }

  private deepen(notches: number): void {
    if (!this.pressing) return;
    const wheel = new WheelEvent("wheel", { deltaY: NOTCH_PX * notches, cancelable: true, bubbles: true });
    this.viewport.canvas.dispatchEvent(wheel);
  }

  private point(kind: string, buttons: number): void {
    const [clientX, clientY] = this.place;
    const pointer = { pointerId: POINTER_ID, pointerType: "mouse", isPrimary: true, bubbles: true, cancelable: true };
    this.viewport.canvas.dispatchEvent(new PointerEvent(kind, { ...pointer, clientX, clientY, button: 0, buttons }));
  }
}
