// The legend of what is drawn: the field's name, unit and range, and keys of the other things.

import type { Shown } from "./body_view";
import { ColorMap } from "./color_map";
import { byId, setText } from "./dom";
import { MINUS } from "./numbers";
import type { FieldMessage } from "./protocol";

/** Units that take over where the numbers would get long: from this value on, divided by the factor. */
const LARGER_UNITS: Record<string, { unit: string; factor: number }[]> = {
  Pa: [
    { unit: "MPa", factor: 1e6 },
    { unit: "kPa", factor: 1e3 },
  ],
};

export class Legend {
  private tissue = "";
  private drawn: ColorMap | null = null;

  setTissue(color: string): void {
    this.tissue = color;
    this.drawn = null;
  }

  show(shown: Shown): void {
    byId("legend-field").hidden = !shown.colors;
    byId("legend-supports").hidden = !shown.supports;
    byId("legend-wireframe").hidden = !shown.wireframe;
  }

  update(field: FieldMessage): void {
    this.drawBar(field.signed ? ColorMap.diverging : ColorMap.sequential);
    const larger = LARGER_UNITS[field.unit]?.find(({ factor }) => field.max >= factor);
    const max = field.max / (larger?.factor ?? 1);
    setText(byId("legend-name"), field.title);
    setText(byId("legend-unit"), larger?.unit ?? field.unit);
    const text = (value: number) => value.toFixed(max >= 100 ? 0 : max >= 10 ? 1 : 2);
    setText(byId("legend-min"), field.signed ? MINUS + text(max) : "0");
    setText(byId("legend-middle"), field.signed ? "0" : text(max / 2));
    setText(byId("legend-max"), (field.signed ? "+" : "") + text(max));
  }

  private drawBar(map: ColorMap): void {
    if (this.drawn === map) return;
    this.drawn = map;
    byId("legend-bar").style.background = map.css(this.tissue);
  }
}
