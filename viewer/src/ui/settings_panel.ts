// What is chosen from lists and by sliders: model, body, field; stiffness, limit of strain, and how large displacements are
// drawn. The tool has a panel of its own.

import type { Control } from "../control";
import type { State, Store } from "../store";
import { byId, setText } from "./dom";
import { pascals, percent } from "./numbers";

/** The usual range of soft tissue, Pa; a body outside it gets a decade to each side of its own value. */
const TISSUE: Range = [1e3, 100e3];
type Range = [low: number, high: number];
/** The slider of the strain at which tools are held goes from 5 % to 50 %; its last step is off. */
const STRAIN_OFF_PERCENT = 51;

export class SettingsPanel {
  private readonly model = byId<HTMLSelectElement>("model");
  private readonly body = byId<HTMLSelectElement>("body");
  private readonly field = byId<HTMLSelectElement>("field");
  private readonly stiffness = byId<HTMLInputElement>("stiffness");
  private readonly strainLimit = byId<HTMLInputElement>("strain-limit");
  private readonly scale = byId<HTMLInputElement>("shown-scale");
  private moduli: Range = TISSUE;

  constructor(store: Store, control: Control) {
    this.model.onchange = () => control.chooseModel(this.model.value);
    this.body.onchange = () => control.chooseBody(this.body.selectedIndex);
    this.field.onchange = () => control.chooseField(this.field.value);
    this.stiffness.oninput = () => control.setStiffness(this.modulus());
    this.strainLimit.oninput = () => control.setStrainLimit(this.chosenStrainLimit());
    this.scale.oninput = () => control.showScaled(this.scale.valueAsNumber);
    store.subscribe(["models"], ({ models }) => {
      byId("model-row").hidden = models.length === 0;
      this.model.replaceChildren(...models.map(({ name, title }) => new Option(title, name)));
    });
    // A model that was refused or cancelled is not the one that is shown.
    store.subscribe(["models", "scene", "status"], ({ scene, status }) => {
      if (scene && !status?.text) this.model.value = scene.name;
    });
    store.subscribe(["scene"], (state) => this.listBodies(state));
    store.subscribe(["scene", "body", "field"], (state) => this.listFields(state));
    store.subscribe(["scene", "body", "settings"], (state) => this.showValues(state));
    store.subscribe(["settings"], ({ settings }) => this.showStrainLimit(settings?.strain_limit ?? 0));
    store.subscribe(["shownScale"], ({ shownScale }) => {
      this.scale.valueAsNumber = shownScale;
      setText(byId("shown-scale-value"), `${shownScale}x`);
      byId("shown-scale-value").classList.toggle("warn", shownScale !== 1);
      byId("scale-banner").hidden = shownScale === 1;
      setText(byId("scale-banner"), `Deformation drawn ${shownScale}x`);
    });
    store.subscribe(["role", "scene", "body"], (state) => this.enable(state));
  }

  private listBodies({ scene, body }: Readonly<State>): void {
    const bodies = scene?.bodies ?? [];
    byId("body-row").hidden = bodies.length < 2;
    this.body.replaceChildren(...bodies.map(({ title }) => new Option(title)));
    this.body.selectedIndex = body;
  }

  private listFields({ scene, body, field }: Readonly<State>): void {
    const fields = scene?.bodies[body]?.fields ?? [];
    const listed = [...this.field.options].map(({ value }) => value);
    if (listed.join() !== fields.map(({ name }) => name).join()) {
      this.field.replaceChildren(...fields.map(({ name, title }) => new Option(title, name)));
    }
    const shown = fields.find(({ name }) => name === field) ?? fields[0];
    if (shown) this.field.value = shown.name;
  }

  private showValues(state: Readonly<State>): void {
    const { scene, body, settings } = state;
    if (!scene || !settings) return;
    this.moduli = rangeOf(scene.bodies[body]?.youngs_modulus ?? null);
    const modulus = settings.youngs_modulus[body] ?? null;
    const [low, high] = this.moduli;
    if (modulus !== null) this.stiffness.valueAsNumber = Math.log(modulus / low) / Math.log(high / low);
    setText(byId("stiffness-value"), modulus === null ? fixedModulus(state) : pascals(modulus));
    byId("stiffness-field").title = modulus === null ? whyFixed(state) : "";
  }

  private showStrainLimit(limit: number): void {
    this.strainLimit.valueAsNumber = limit > 0 ? 100 * limit : STRAIN_OFF_PERCENT;
    setText(byId("strain-limit-value"), limit > 0 ? percent(limit) : "off");
  }

  private chosenStrainLimit(): number {
    const chosen = this.strainLimit.valueAsNumber;
    return chosen >= STRAIN_OFF_PERCENT ? 0 : chosen / 100;
  }

  private modulus(): number {
    const [low, high] = this.moduli;
    return low * (high / low) ** this.stiffness.valueAsNumber;
  }

  private enable({ role, scene, body }: Readonly<State>): void {
    const watching = role !== "control";
    this.stiffness.disabled = watching || scene?.bodies[body]?.youngs_modulus == null;
    this.strainLimit.disabled = this.model.disabled = watching;
  }
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

function whyFixed({ scene, body }: Readonly<State>): string {
  return scene?.motion?.body === body
    ? "Fixed: the modes of a body in motion belong to its stiffness"
    : "Fixed: the body has several materials, or loads";
}
