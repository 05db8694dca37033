// Keyboard shortcuts, for what a hand at the mouse needs at once.

import type { Control } from "../control";
import type { Painting } from "../painting";
import type { Viewport } from "../scene/viewport";

/** Keys and what they do, in the order in which the help tells of them. */
export const KEYS: readonly (readonly [key: string, what: string])[] = [
  ["r", "reset: release the tools, clear a fault, restore the sliders"],
  ["n", "pin the tool, or release pinned ones"],
  ["Escape", "release all tools, end a mode"],
  ["g", "grab instead of pressing"],
  ["k", "a click strikes, on a body in motion"],
  ["f", "the next field in colours"],
  ["c", "colours"],
  ["w", "wire frame of the shape at rest"],
  ["s", "supported nodes"],
  ["x", "cut open"],
  ["p", "plots"],
  ["v", "look from the front again"],
  ["b", "paint with a brush what is to be computed next"],
  ["l", "paint it with a lasso"],
  ["[ ]", "a smaller brush, a larger one"],
  ["u", "undo the last stroke"],
  ["Enter", "compute what is painted"],
  ["m", "in an exam: the nodule is where the tool touches"],
  ["0", "in an exam: there is none"],
  ["Space", "press the middle of the picture, or release the tool; while the picture has the focus"],
  ["Arrows", "slide the tool, or turn the picture; while it has the focus"],
  ["PgDn PgUp", "deeper, or less deep; while the picture has the focus"],
  ["+ -", "zoom; while the picture has the focus"],
  ["?", "this help"],
];

export function listenToKeys(control: Control, painting: Painting, viewport: Viewport, toggleHelp: () => void): void {
  const actions: Record<string, () => void> = {
    r: () => control.reset(),
    v: () => viewport.reframe(),
    w: () => control.toggleLayer("wireframe"),
    c: () => control.toggleLayer("colors"),
    x: () => control.toggleLayer("cutaway"),
    s: () => control.toggleLayer("supports"),
    f: () => control.nextField(),
    p: () => control.togglePlots(),
    g: () => control.toggleGrab(),
    k: () => control.toggleStrike(),
    n: () => control.togglePin(),
    b: () => painting.choose("brush"),
    l: () => painting.choose("lasso"),
    "[": () => painting.changeBrush(-1),
    "]": () => painting.changeBrush(1),
    u: () => painting.undo(),
    Enter: () => painting.compute(),
    m: () => control.answer(true),
    "0": () => control.answer(false),
    "?": toggleHelp,
    Escape: () => {
      control.release();
      control.showMode(0);
      painting.leavePaintTool();
    },
  };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || takesKeys(event.target, event.key)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    // Over the help only the key that ends it.
    if (document.querySelector("dialog[open]") && key !== "?") return;
    const action = actions[key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

/** Lists choose by letters, and what is typed into a field is text. */
function takesKeys(target: EventTarget | null, key: string): boolean {
  if (target instanceof HTMLInputElement) return target.type === "text";
  // A button that has the focus is pressed by Enter.
  if (target instanceof HTMLButtonElement && key === "Enter") return true;
  return target instanceof HTMLSelectElement;
}
