// Three fingers move the picture across. One presses, or turns beside the body, and two turn and zoom: OrbitControls has those.

import type { Viewport } from "../scene/viewport";

const FINGERS = 3;

export class TouchPan {
  private readonly fingers = new Map<number, { x: number; y: number }>();

  constructor(private readonly viewport: Viewport) {
    const { canvas } = viewport;
    canvas.addEventListener("pointerdown", (event) => this.follow(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, ({ pointerId }) => this.fingers.delete(pointerId));
    }
  }

  private follow({ pointerId, pointerType, clientX, clientY }: PointerEvent): void {
    if (pointerType === "touch") this.fingers.set(pointerId, { x: clientX, y: clientY });
  }

  private onMove(event: PointerEvent): void {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    this.follow(event);
    if (this.fingers.size !== FINGERS) return;
    // Each finger moves the middle of all by its share.
    this.viewport.controls.pan((event.clientX - before.x) / FINGERS, (event.clientY - before.y) / FINGERS);
  }
}
