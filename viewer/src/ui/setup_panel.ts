// The controls of a body that is set up: its size and unit, supports, material, tool and nodule.

import type { SetupBody, SetupMessage, SupportPlane, Tissue } from "../net/setup_messages";
import type { Painting } from "../painting";
import { editedBody, hindrance } from "../setup";
import type { Setup } from "../setup";
import { inControl } from "../store";
import type { State, Store } from "../store";
import { paintControls } from "./paint_controls";
import { byId, create, disable, list, press, setText } from "./dom";
import { millimetres, pascals, sizeText } from "./numbers";
import { Slider } from "./slider";

/** Sides of the body, by the axis that a plane is across. */
const SIDES = [
  { id: "x-low", axis: 0, above: false },
  { id: "x-high", axis: 0, above: true },
  { id: "y-low", axis: 1, above: false },
  { id: "y-high", axis: 1, above: true },
  { id: "z-low", axis: 2, above: false },
  { id: "z-high", axis: 2, above: true },
] as const;
/** A plane at first, and at most, as a share of the body behind it. */
const DEPTH_SHARE = 0.1;
const DEPTH_MOST = 0.9;
/** Radii over the longest side, as the server takes them. */
const [RADIUS_LEAST, RADIUS_MOST] = [1 / 200, 1 / 3];
const NODULE_LEAST = 0.02;
const LENGTHS = { mm: 1e-3, cm: 1e-2, m: 1 };
const PASCALS = { Pa: 1, kPa: 1e3, MPa: 1e6 };
/** A nodule's stiffness over the body's. */
const [FACTOR_LEAST, FACTOR_MOST] = [0.1, 100];

export class SetupPanel {
  private readonly depth: Slider;
  private readonly radius: Slider;
  private readonly noduleRadius: Slider;
  private readonly noduleModulus: Slider;
  private readonly tissue = byId<HTMLSelectElement>("setup-tissue");
  private readonly unit = byId<HTMLSelectElement>("setup-unit");

  constructor(
    private readonly store: Store,
    private readonly setup: Setup,
    painting: Painting,
    private readonly notice: (text: string) => void,
  ) {
    this.depth = this.lengthSlider("setup-depth", "Depth", (depth) => this.choosePlane({ depth }));
    this.radius = this.lengthSlider("setup-radius", "Tool radius", (radius) => setup.choose({ radius }));
    this.noduleRadius = this.lengthSlider("nodule-radius", "Nodule", (radius) => setup.moveNodule({ radius }));
    this.noduleModulus = this.modulusSlider();
    paintControls("setup", "setup-brush-size", painting, store, notice);
    this.listen(painting);
    store.subscribe(["setup", "status", "role", "connection", "strokes"], (state) => this.show(state));
  }

  private listen(painting: Painting): void {
    const { setup, store } = this;
    for (const { id, axis, above } of SIDES) {
      byId(`side-${id}`).onclick = () => {
        const body = editedBody(store.get());
        if (body) setup.choose({ plane: { axis, above, depth: DEPTH_SHARE * body.size[axis] }, painted: false });
      };
    }
    byId("setup-plane").onclick = () => setup.choose({ painted: false });
    byId("setup-paint").onclick = () => {
      setup.choose({ painted: true });
      if (store.get().paintTool === null) painting.choose("brush");
    };
    this.tissue.onchange = () => setup.choose({ tissue: this.tissue.value });
    this.unit.onchange = () => setup.choose({ unit: this.unit.value });
    byId("setup-nodule").onclick = () => setup.toggleNodule();
    byId("setup-touch").onclick = () => {
      const reason = hindrance(store.get());
      if (reason) this.notice(reason);
      else setup.touch();
    };
    for (const id of ["setup-save", "touched-save"]) byId(id).onclick = () => setup.save();
    byId("touched-edit").onclick = () => setup.edit();
  }

  private show(state: Readonly<State>): void {
    const { setup } = state;
    const editing = setup?.editing === true;
    document.body.classList.toggle("setting-up", editing || setup?.preparing === true);
    byId("setup").hidden = !editing || !setup.body;
    byId("touched").hidden = editing || !setup?.body;
    if (!setup?.body) return;
    this.showSaved(setup.body);
    const enabled = editing ? editedBody(state) !== null : inControl(state) && !state.status?.text;
    for (const input of byId(editing ? "setup" : "touched").querySelectorAll<HTMLInputElement>("button, select, input")) {
      input.disabled = !enabled;
    }
    if (editing) this.showBody(state, setup, setup.body);
  }

  private showBody(state: Readonly<State>, setup: SetupMessage, body: SetupBody): void {
    setText(byId("setup-file"), body.file);
    setText(byId("setup-size"), sizeText(body.size));
    const counts = `${body.nodes.toLocaleString("en")} nodes, ${body.tets.toLocaleString("en")} tetrahedra`;
    setText(byId("setup-mesh"), body.filled ? counts : "being filled with tetrahedra");
    byId("setup-notes").replaceChildren(...body.notes.map((note) => create("li", {}, note)));
    this.showUnit(body);
    this.showSupports(state, body);
    this.showMaterial(setup, body);
    const longest = Math.max(...body.size);
    bound(this.radius, RADIUS_LEAST * longest, RADIUS_MOST * longest);
    this.radius.show(body.radius);
    press("setup-nodule", body.nodule !== null);
    byId("nodule-fields").hidden = body.nodule === null;
    if (body.nodule) {
      bound(this.noduleRadius, NODULE_LEAST * longest, RADIUS_MOST * longest);
      this.noduleRadius.show(body.nodule.radius);
      this.noduleModulus.show(body.nodule.youngs_modulus);
    }
    const reason = hindrance(state);
    byId("setup-touch").setAttribute("aria-disabled", String(reason !== null));
    byId("setup-touch").title = reason ?? "Compute what every touch needs, and touch the body";
    byId("setup-save").setAttribute("aria-disabled", String(reason !== null));
  }

  /** The question for the unit, where the file may be in several; later a list. */
  private showUnit(body: SetupBody): void {
    const asked = body.unit === null && body.filled;
    byId("setup-question").hidden = !asked;
    byId("setup-unit-row").hidden = body.unit === null;
    if (asked) {
      byId("setup-units").replaceChildren(
        ...body.units.filter(({ unit }) => body.fitting.includes(unit)).map(({ unit, size }) => this.unitButton(unit, sizeText(size))),
      );
    }
    if (this.unit.options.length !== body.units.length || this.unit.dataset["of"] !== body.file) {
      this.unit.dataset["of"] = body.file;
      this.unit.replaceChildren(...body.units.map(({ unit, size }) => new Option(`${unit} (${sizeText(size)})`, unit)));
    }
    this.unit.value = body.unit ?? "";
  }

  private unitButton(unit: string, size: string): HTMLElement {
    const onclick = () => this.setup.choose({ unit });
    const button = create("button", { type: "button", onclick }, create("b", {}, unit), ` ${size}`);
    button.dataset["testid"] = `unit-${unit}`;
    return button;
  }

  private showSupports({ strokes }: Readonly<State>, body: SetupBody): void {
    const { painted, plane } = body;
    press("setup-plane", !painted);
    press("setup-paint", painted);
    byId("plane-fields").hidden = painted;
    byId("paint-fields").hidden = !painted;
    for (const { id, axis, above } of SIDES) press(`side-${id}`, axis === plane.axis && above === plane.above);
    bound(this.depth, 0.002 * body.size[plane.axis], DEPTH_MOST * body.size[plane.axis]);
    this.depth.show(plane.depth);
    if (strokes.length === 0) disable(["setup-undo", "setup-clear"], true);
  }

  private showMaterial(setup: SetupMessage, body: SetupBody): void {
    const tissues = setup.tissues;
    list(this.tissue, [...(body.tissue === null ? [{ name: "", title: "As set while touching" }] : []), ...tissues]);
    this.tissue.value = body.tissue ?? "";
    const chosen = tissues.find(({ name }) => name === body.tissue);
    const spread = chosen && chosen.spread > 0 ? ` ± ${pascals(chosen.spread)}` : "";
    setText(byId("setup-modulus"), `E = ${pascals(body.youngs_modulus)}${spread}, ν = ${body.poissons_ratio}`);
    setText(byId("setup-source"), chosen?.source ?? "");
    this.showSegments(setup, body);
  }

  /** A material for each segment of a label map within the largest. */
  private showSegments({ tissues }: SetupMessage, { file, segments }: SetupBody): void {
    const rows = byId("setup-segments");
    const of = JSON.stringify([file, segments.map(({ name }) => name)]);
    if (rows.dataset["of"] !== of) {
      rows.dataset["of"] = of;
      rows.replaceChildren(...segments.map(({ name }) => this.segmentRow(name, tissues)));
    }
    [...rows.querySelectorAll("select")].forEach((select, i) => (select.value = segments[i]!.tissue));
  }

  private segmentRow(name: string, tissues: readonly Tissue[]): HTMLElement {
    const select = create("select", { onchange: () => this.setup.chooseSegment(name, select.value) });
    select.dataset["testid"] = `segment-${name}`;
    list(select, tissues);
    return create("label", { className: "row line" }, create("span", {}, name), select);
  }

  private showSaved({ saved }: SetupBody): void {
    for (const part of ["setup", "touched"]) {
      byId(`${part}-saved`).hidden = saved === null;
      if (saved === null) continue;
      setText(byId(`${part}-saved-path`), saved);
      setText(byId(`${part}-saved-run`), `palpate run ${quoted(saved)}`);
    }
  }

  private choosePlane(change: Partial<SupportPlane>): void {
    const body = editedBody(this.store.get());
    if (body) this.setup.choose({ plane: { ...body.plane, ...change } });
  }

  private lengthSlider(id: string, name: string, choose: (value: number) => void): Slider {
    const showError = this.notice;
    return new Slider({ id, name, format: millimetres, units: LENGTHS, usual: "mm", choose, showError });
  }

  private modulusSlider(): Slider {
    const own = () => this.store.get().setup?.body?.youngs_modulus ?? 1;
    const [low, high] = [Math.log(FACTOR_LEAST), Math.log(FACTOR_MOST)];
    return new Slider({
      id: "nodule-modulus",
      name: "Nodule stiffness",
      format: pascals,
      units: PASCALS,
      scale: {
        toTrack: (modulus) => (Math.log(modulus / own()) - low) / (high - low),
        fromTrack: (place) => Number((own() * Math.exp(low + place * (high - low))).toPrecision(3)),
      },
      bounds: () => [FACTOR_LEAST * own(), FACTOR_MOST * own()],
      choose: (modulus) => this.setup.moveNodule({ youngs_modulus: modulus }),
      showError: this.notice,
    });
  }
}

/** Ends of a slider for lengths, in two hundred steps of round numbers. */
function bound({ input }: Slider, low: number, high: number): void {
  const step = 10 ** Math.floor(Math.log10((high - low) / 100));
  input.step = String(step);
  input.min = String(Math.max(step, Math.round(low / step) * step));
  input.max = String(Math.floor(high / step) * step);
}

/** A path as a shell takes it. */
function quoted(path: string): string {
  return /^[\w./-]+$/.test(path) ? path : `'${path.replaceAll("'", "'\\''")}'`;
}
