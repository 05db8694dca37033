// The legend of what is drawn: a field's name, unit and range, or regions and materials; and keys of the other things.

import type { Control } from "../control";
import type { FieldMessage } from "../net/protocol";
import { grouped } from "../regions";
import type { Group } from "../regions";
import { ColorMap } from "../scene/color_map";
import type { State, Store } from "../store";
import { byId, create, press, setText, showText } from "./dom";
import { MINUS, parseQuantity, pascals, sizeText } from "./numbers";

/** Units that take over where the numbers would get long: from this value on, divided by the factor. */
const LARGER_UNITS: Record<string, { unit: string; factor: number }[]> = {
  Pa: [
    { unit: "MPa", factor: 1e6 },
    { unit: "kPa", factor: 1e3 },
  ],
};
/** Below this share of its range a field is at rest. */
const AT_REST = 0.02;
/** More regions than these would cover the picture. */
const GROUPS_MAX = 8;

export class Legend {
  private readonly max = byId<HTMLInputElement>("legend-max");
  private drawn: ColorMap | null = null;
  private field: FieldMessage | null = null;
  private sent = "";

  constructor(private readonly store: Store, private readonly control: Control) {
    byId("legend-lock").onclick = () => this.toggleLock();
    this.max.onfocus = () => this.max.select();
    this.max.onchange = () => this.lockMax();
    this.max.onkeydown = ({ key }) => {
      if (key === "Escape") this.max.value = "";
      // What is shown is written anew.
      this.sent = "";
      if (key === "Enter" || key === "Escape") this.max.blur();
    };
    store.subscribe(["scene", "body"], ({ scene, body }) => {
      const { triangles = 0, drawn = null } = scene?.bodies[body] ?? {};
      const [few, all] = [drawn?.triangles ?? 0, triangles].map((count) => count.toLocaleString("en"));
      showText(byId("legend-drawn"), drawn && `Drawn by ${few} of ${all} triangles; felt on all.`);
    });
    store.subscribe(["sizes", "body"], ({ sizes, body }) => {
      const sides = sizes[body];
      showText(byId("legend-size"), sides ? `Body of ${sizeText(sides)}` : null);
    });
    store.subscribe(["layers", "coloring"], ({ layers, coloring }) => {
      const groups = coloring === "region" || coloring === "material";
      byId("legend-field").hidden = !layers.colors || groups;
      byId("legend-groups").hidden = !layers.colors || !groups;
      byId("legend-supports").hidden = !layers.supports;
      byId("legend-wireframe").hidden = !layers.wireframe;
    });
    store.subscribe(["scene", "coloring", "settings"], (state) => this.listGroups(state));
    store.subscribe(["shownScale"], ({ shownScale }) => {
      byId("legend-scale").hidden = shownScale === 1;
      setText(byId("legend-scale-text"), `Deformation drawn ${shownScale}x, colours and numbers true`);
    });
    store.subscribe(["frame", "layers", "coloring", "shownScale"], (state) => this.quiet(state));
    store.subscribe(["frame", "body", "ranges"], ({ frame, body, ranges }) => {
      this.field = frame?.fields[body] ?? null;
      if (this.field) this.show(this.field, this.field.name in ranges);
    });
  }

  private show(field: FieldMessage, locked: boolean): void {
    // At rest, as in most frames, nothing is written: the browser would lay out again.
    const sent = JSON.stringify([field, locked]);
    if (sent === this.sent) return;
    this.sent = sent;
    this.drawBar(field.signed ? ColorMap.diverging : ColorMap.sequential);
    const { unit, factor } = unitOf(field);
    const [min, max] = [field.min / factor, field.max / factor];
    const text = (value: number) => value.toFixed(max >= 100 ? 0 : max >= 10 ? 1 : max >= 0.1 ? 2 : 3);
    setText(byId("legend-name"), field.title);
    setText(byId("legend-unit"), unit);
    setText(byId("legend-min"), field.signed ? MINUS + text(max) : min === 0 ? "0" : text(min));
    setText(byId("legend-middle"), field.signed ? "0" : text((min + max) / 2));
    if (document.activeElement !== this.max) this.max.value = (field.signed ? "+" : "") + text(max);
    press("legend-lock", locked);
    byId("legend-lock").title = locked ? "Let the range follow the largest value again" : "Keep this range";
    showText(byId("legend-largest"), locked ? `Range locked; largest now ${text(field.largest / factor)}` : null);
  }

  /** With few controls there is no legend until there is something to explain: tissue that is strained, or more. */
  private quiet({ frame, body, layers, coloring, shownScale }: Readonly<State>): void {
    const { largest = 0, max = 1 } = frame?.fields[body] ?? {};
    const strained = largest > AT_REST * max;
    const colored = layers.colors && (coloring !== "strained" || strained);
    const quiet = !colored && !layers.supports && !layers.wireframe && shownScale === 1;
    byId("legend").classList.toggle("quiet", quiet);
  }

  private drawBar(map: ColorMap): void {
    if (this.drawn === map) return;
    this.drawn = map;
    const bar = byId<HTMLCanvasElement>("legend-bar");
    const context = bar.getContext("2d")!;
    const gradient = context.createLinearGradient(0, 0, bar.width, 0);
    map.stops().forEach((color, i, { length }) => gradient.addColorStop(i / (length - 1), color));
    context.fillStyle = gradient;
    context.fillRect(0, 0, bar.width, bar.height);
  }

  /** Keeps the range as it is, rounded up; or lets it go. */
  private toggleLock(): void {
    const { field } = this;
    if (!field) return;
    const locked = field.name in this.store.get().ranges;
    this.control.lockRange(field.name, locked ? null : roundedUp(field.max));
  }

  /** A number that is typed locks the range there. */
  private lockMax(): void {
    const { field } = this;
    if (!field) return;
    const { unit, factor } = unitOf(field);
    const units = { [unit]: factor, ...Object.fromEntries((LARGER_UNITS[field.unit] ?? []).map((one) => [one.unit, one.factor])), [field.unit]: 1 };
    const typed = this.max.value;
    if (typed.trim() === "") return;
    const value = parseQuantity(typed, units, unit);
    if (value !== null && value > 0) this.control.lockRange(field.name, value);
    else this.control.notice(`Range: '${typed}' is not a positive number in ${Object.keys(units).join(" or ")}`);
  }

  private listGroups(state: Readonly<State>): void {
    const { scene, coloring } = state;
    if (!scene || coloring === "field" || coloring === "strained") return;
    const { groups } = grouped(scene, coloring);
    const shown = groups.length > GROUPS_MAX ? groups.slice(0, GROUPS_MAX - 1) : groups;
    const entries = shown.map((group) => entry(group.color, titleOf(group, state)));
    if (shown.length < groups.length) entries.push(entry(null, `and ${groups.length - shown.length} more`));
    byId("legend-groups").replaceChildren(...entries);
  }
}

function unitOf({ unit, max }: FieldMessage): { unit: string; factor: number } {
  return LARGER_UNITS[unit]?.find(({ factor }) => max >= factor) ?? { unit, factor: 1 };
}

/** To two digits, and no less. */
function roundedUp(value: number): number {
  const step = 10 ** (Math.floor(Math.log10(value)) - 1);
  return Number((Math.ceil(value / step - 1e-6) * step).toPrecision(2));
}

/** A region by its name, a material by its numbers; a stiffness that was changed while running is shown as it is. */
function titleOf({ body, region }: Group, { scene, coloring, settings }: Readonly<State>): string {
  const modulus = settings?.youngs_modulus[body] ?? region.youngs_modulus;
  if (coloring === "material") return `${pascals(modulus)}, ν ${region.poissons_ratio}, ${region.density} kg/m³`;
  const { title, regions } = scene!.bodies[body]!;
  if (scene!.bodies.length === 1) return region.title;
  return regions.length === 1 ? title : `${title}: ${region.title}`;
}

function entry(color: string | null, title: string): HTMLElement {
  const swatch = create("span", { className: "key key-group" });
  if (color) swatch.style.backgroundColor = color;
  return create("p", { className: "line" }, swatch, title);
}
