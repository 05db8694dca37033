// The legend of what is drawn: the field's name, unit and range, and keys of the other things.

import type { FieldMessage } from "../net/protocol";
import { ColorMap } from "../scene/color_map";
import { tissueColor } from "../scene/field_material";
import type { Store } from "../store";
import { byId, setText } from "./dom";
import { MINUS, sizeText } from "./numbers";

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

  constructor(store: Store) {
    store.subscribe(["scene", "body"], ({ scene, body }) => {
      this.tissue = tissueColor(scene?.bodies[body]?.name ?? "").getStyle();
      this.drawn = null;
    });
    store.subscribe(["sizes", "body"], ({ sizes, body }) => {
      const sides = sizes[body];
      byId("legend-size").hidden = !sides;
      if (sides) setText(byId("legend-size"), `Body of ${sizeText(sides)}`);
    });
    store.subscribe(["layers"], ({ layers }) => {
      byId("legend-field").hidden = !layers.colors;
      byId("legend-supports").hidden = !layers.supports;
      byId("legend-wireframe").hidden = !layers.wireframe;
    });
    store.subscribe(["shownScale"], ({ shownScale }) => {
      byId("legend-scale").hidden = shownScale === 1;
      setText(byId("legend-scale-text"), `Deformation drawn ${shownScale}x, colours and numbers true`);
    });
    store.subscribe(["frame", "body"], ({ frame, body }) => {
      const field = frame?.fields[body];
      if (field) this.show(field);
    });
  }

  private show(field: FieldMessage): void {
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
