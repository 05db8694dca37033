// Brush, lasso, undo and clear, which stand in two panels.

import { BRUSH_MAX, BRUSH_MIN } from "../painting";
import type { Painting } from "../painting";
import type { Store } from "../store";
import { byId, press } from "./dom";
import { Slider } from "./slider";

const TOOLS = ["brush", "lasso"] as const;

/** The buttons `<prefix>-brush` and so on, and the slider of the brush; `showError` gets what is wrong with a typed size. */
export function paintControls(prefix: string, brush: string, painting: Painting, store: Store, showError: (text: string) => void): void {
  for (const tool of TOOLS) byId(`${prefix}-${tool}`).onclick = () => painting.choose(tool);
  byId(`${prefix}-undo`).onclick = () => painting.undo();
  byId(`${prefix}-clear`).onclick = () => painting.clear();
  Object.assign(byId<HTMLInputElement>(brush), { min: String(BRUSH_MIN), max: String(BRUSH_MAX) });
  const slider = new Slider({
    id: brush,
    name: "Brush",
    format: (radius) => `${Math.round(radius)} px`,
    units: { px: 1 },
    usual: "px",
    choose: (radius) => painting.setBrush(radius),
    showError,
  });
  store.subscribe(["paintTool"], ({ paintTool }) => {
    for (const tool of TOOLS) press(`${prefix}-${tool}`, tool === paintTool);
  });
  store.subscribe(["brushRadius"], ({ brushRadius }) => slider.show(brushRadius));
}
