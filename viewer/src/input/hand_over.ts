// Hand-over of a press to the camera at the second finger: its controls first get the event of the first finger, which they missed.

import type { Place } from "../window_regions";

/** Tells the camera's controls of a pointer that went down, at the place where it is now. */
export function byCamera(canvas: HTMLCanvasElement, { pointerId, pointerType }: PointerEvent, [clientX, clientY]: Place): void {
  const again = { pointerId, pointerType, clientX, clientY, isPrimary: true, bubbles: true, button: 0 };
  canvas.dispatchEvent(new PointerEvent("pointerdown", again));
}
