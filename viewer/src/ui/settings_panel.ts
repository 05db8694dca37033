// Lists and sliders: model, body, field; stiffness, limit of strain, and how large displacements are
// drawn. The tool has a panel of its own.

import type { Control } from "../control";
import { groupings } from "../regions";
import type { State, Store } from "../store";
import { byId, list, showText } from "./dom";
import { pascals, percent } from "./numbers";
import { Slider } from "./slider";

/** The usual range of soft tissue, Pa; a body outside it gets a decade to each side of its own value. */
const TISSUE: Range = [1e3, 100e3];
type Range = [low: number, high: number];
/** The slider of the strain at which tools are held goes from 5 % to 50 %; its last step is off. */
const STRAIN_BOUNDS: Range = [0.05, 0.5];
const STRAIN_OFF_PERCENT = 51;
/** Moduli that may be typed, Pa: those that the program takes. */
const MODULI: Range = [1e-6, 1e15];
const PASCALS = { Pa: 1, kPa: 1e3, MPa: 1e6, GPa: 1e9 };

/** In the list of fields, before what is no field; and the first entry. */
const GROUPED = "by-";
const STRAINED = { name: "tissue", title: "Tissue and strain" };
const GROUPING_TITLES = { region: "Region", material: "Material" };

export class SettingsPanel {
  private readonly model = byId<HTMLSelectElement>("model");
  private readonly body = byId<HTMLSelectElement>("body");
  private readonly field = byId<HTMLSelectElement>("field");
  private readonly stiffness: Slider;
  private readonly strainLimit: Slider;
  private readonly scale: Slider;
  private moduli: Range = TISSUE;

  constructor(store: Store, control: Control) {
    this.model.onchange = () => control.chooseModel(this.model.value);
    this.body.onchange = () => control.chooseBody(this.body.selectedIndex);
    this.field.onchange = () => this.chooseColors(control);
    this.stiffness = this.stiffnessSlider(store, control);
    this.strainLimit = strainSlider(store, control);
    this.scale = new Slider({
      id: "shown-scale",
      name: "Exaggeration",
      format: (value) => `${value}x`,
      units: { x: 1 },
      fallback: () => 1,
      choose: (value) => control.showScaled(value),
      showError: (text) => control.notice(text),
    });
    store.subscribe(["models"], ({ models }) => {
      byId("model-row").hidden = models.length === 0;
      list(this.model, models);
    });
    // A model that was refused or cancelled is not the one that is shown.
    store.subscribe(["models", "scene", "status"], ({ scene, status }) => {
      if (scene && !status?.text) this.model.value = scene.name;
    });
    store.subscribe(["scene"], (state) => this.listBodies(state));
    store.subscribe(["scene", "body", "field", "coloring"], (state) => this.listFields(state));
    store.subscribe(["scene", "body", "settings"], (state) => this.showValues(state));
    store.subscribe(["scene", "settings"], ({ settings }) => this.strainLimit.show(settings?.strain_limit ?? 0));
    store.subscribe(["shownScale"], ({ shownScale }) => {
      this.scale.show(shownScale);
      byId("shown-scale-value").classList.toggle("warn", shownScale !== 1);
      showText(byId("scale-banner"), shownScale === 1 ? null : `Deformation drawn ${shownScale}x`);
    });
    store.subscribe(["role", "scene", "body"], (state) => this.enable(state));
  }

  private listBodies({ scene, body }: Readonly<State>): void {
    const bodies = scene?.bodies ?? [];
    byId("body-row").hidden = bodies.length < 2;
    this.body.replaceChildren(...bodies.map(({ title }) => new Option(title)));
    this.body.selectedIndex = body;
  }

  /** Fields of the body, and what else may be told apart by colours. */
  private listFields({ scene, body, field, coloring }: Readonly<State>): void {
    const { fields = [], server_fields = [] } = scene?.bodies[body] ?? {};
    const groups = groupings(scene).map((by) => ({ name: GROUPED + by, title: GROUPING_TITLES[by] }));
    const others = server_fields.map(({ name, title }) => ({ name, title: `${title}: needs a server`, disabled: true }));
    list(this.field, [STRAINED, ...fields, ...groups, ...others]);
    const shown = fields.find(({ name }) => name === field) ?? fields[0];
    if (coloring === "strained") this.field.value = STRAINED.name;
    else if (coloring !== "field") this.field.value = GROUPED + coloring;
    else if (shown) this.field.value = shown.name;
  }

  private chooseColors(control: Control): void {
    const { value } = this.field;
    const grouping = (["region", "material"] as const).find((by) => value === GROUPED + by);
    if (grouping) control.chooseGrouping(grouping);
    else if (value === STRAINED.name) control.chooseStrained();
    else control.chooseField(value);
  }

  private showValues(state: Readonly<State>): void {
    const { scene, body, settings } = state;
    if (!scene || !settings) return;
    this.moduli = rangeOf(scene.defaults.youngs_modulus[body] ?? null);
    const modulus = settings.youngs_modulus[body] ?? null;
    this.stiffness.show(modulus ?? this.moduli[0], modulus === null ? fixedModulus(state) : null);
    byId("stiffness-field").title = modulus === null ? fixedModulusReason(state) : "";
  }

  private stiffnessSlider(store: Store, control: Control): Slider {
    return new Slider({
      id: "stiffness",
      name: "Material stiffness",
      format: pascals,
      units: PASCALS,
      scale: {
        toTrack: (modulus) => Math.log(modulus / this.moduli[0]) / Math.log(this.moduli[1] / this.moduli[0]),
        fromTrack: (place) => this.moduli[0] * (this.moduli[1] / this.moduli[0]) ** place,
      },
      bounds: () => MODULI,
      fallback: () => {
        const { scene, body } = store.get();
        return scene?.defaults.youngs_modulus[body] ?? null;
      },
      choose: (modulus) => control.setStiffness(modulus),
      showError: (text) => control.notice(text),
    });
  }

  private enable({ role, scene, body }: Readonly<State>): void {
    const watching = role !== "control";
    this.stiffness.disabled = watching || scene?.bodies[body]?.youngs_modulus == null;
    this.strainLimit.disabled = this.model.disabled = watching;
  }
}

function strainSlider(store: Store, control: Control): Slider {
  return new Slider({
    id: "strain-limit",
    name: "Hold at strain",
    format: (limit) => (limit > 0 ? percent(limit) : "off"),
    units: { "%": 0.01 },
    usual: "%",
    words: { off: 0 },
    scale: {
      toTrack: (limit) => (limit > 0 ? 100 * limit : STRAIN_OFF_PERCENT),
      fromTrack: (place) => (place >= STRAIN_OFF_PERCENT ? 0 : place / 100),
    },
    bounds: () => STRAIN_BOUNDS,
    fallback: () => store.get().scene?.defaults.strain_limit ?? null,
    choose: (limit) => control.setStrainLimit(limit),
    showError: (text) => control.notice(text),
  });
}

function rangeOf(modulus: number | null): Range {
  if (modulus === null || (modulus >= TISSUE[0] && modulus <= TISSUE[1])) return TISSUE;
  return [modulus / 10, modulus * 10];
}

/** What is told in place of a stiffness that cannot be changed. */
function fixedModulus({ scene, body }: Readonly<State>): string {
  const { motion } = scene!;
  return motion?.body === body && motion.youngs_modulus !== null ? pascals(motion.youngs_modulus) : "several";
}

function fixedModulusReason({ scene, body }: Readonly<State>): string {
  return scene?.motion?.body === body
    ? "Fixed: the modes of a body in motion belong to its stiffness"
    : "Fixed: the body has several materials, or loads";
}
