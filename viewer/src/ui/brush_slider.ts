// The slider of the brush that paints, px on the screen.

import { BRUSH_MAX, BRUSH_MIN } from "../painting";
import type { Painting } from "../painting";
import { byId } from "./dom";
import { Slider } from "./slider";

/** The slider of an element; `showError` gets what is wrong with a typed size. */
export function brushSlider(id: string, painting: Painting, showError: (text: string) => void): Slider {
  Object.assign(byId<HTMLInputElement>(id), { min: String(BRUSH_MIN), max: String(BRUSH_MAX) });
  return new Slider({
    id,
    name: "Brush",
    format: (radius) => `${Math.round(radius)} px`,
    units: { px: 1 },
    usual: "px",
    fallback: () => null,
    choose: (radius) => painting.setBrush(radius),
    showError,
  });
}
