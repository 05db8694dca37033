// One key for each thing that a mouse hand may want at once.

import type { Control } from "../control";
import type { Viewport } from "../scene/viewport";

export function listenToKeys(control: Control, viewport: Viewport): void {
  const actions: Record<string, () => void> = {
    r: () => control.reset(),
    v: () => viewport.reframe(),
    w: () => control.toggleLayer("wireframe"),
    c: () => control.toggleLayer("colors"),
    x: () => control.toggleLayer("cutaway"),
    s: () => control.toggleLayer("supports"),
    f: () => control.nextField(),
    p: () => control.toggleLayer("plots"),
    g: () => control.toggleGrab(),
    k: () => control.toggleStrike(),
    n: () => control.togglePin(),
    Escape: () => {
      control.release();
      control.showMode(0);
    },
  };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    // A list of models takes letters itself.
    if (event.target instanceof HTMLSelectElement) return;
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}
