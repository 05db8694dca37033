// What is chosen from lists and by sliders: model, body, field, stiffness, contact radius.

import type { Control } from "../control";
import { drivenTool } from "../store";
import type { State, Store } from "../store";
import { byId, setText } from "./dom";
import { millimetres, pascals } from "./numbers";

/** The usual range of soft tissue, Pa; a body outside it gets a decade to each side of its own value. */
const TISSUE: Range = [1e3, 100e3];
type Range = [low: number, high: number];

export class SettingsPanel {
  private readonly model = byId<HTMLSelectElement>("model");
  private readonly body = byId<HTMLSelectElement>("body");
  private readonly field = byId<HTMLSelectElement>("field");
  private readonly stiffness = byId<HTMLInputElement>("stiffness");
  private readonly radius = byId<HTMLInputElement>("radius");
  private moduli: Range = TISSUE;

  constructor(store: Store, control: Control) {
    this.model.onchange = () => control.chooseModel(this.model.value);
    this.body.onchange = () => control.chooseBody(this.body.selectedIndex);
    this.field.onchange = () => control.chooseField(this.field.value);
    this.stiffness.oninput = () => control.setStiffness(this.modulus());
    this.radius.oninput = () => control.setContactRadius(this.radius.valueAsNumber);
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
    store.subscribe(["scene", "body", "settings", "pinned", "pressing"], (state) => this.showValues(state));
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
    const moves = scene.motion?.body === body;
    byId("stiffness-field").title = moves ? "The modes of a body in motion belong to its stiffness" : "";
    const tool = drivenTool(state) ?? 0;
    const { max_contact_radius: largest } = scene.tools[tool]!;
    const radius = settings.contact_radius[tool] ?? 0;
    this.radius.max = String(largest);
    this.radius.step = String(largest / 200);
    this.radius.valueAsNumber = radius;
    setText(byId("radius-value"), millimetres(radius));
  }

  private modulus(): number {
    const [low, high] = this.moduli;
    return low * (high / low) ** this.stiffness.valueAsNumber;
  }

  private enable({ role, scene, body }: Readonly<State>): void {
    const watching = role !== "control";
    this.stiffness.disabled = watching || scene?.bodies[body]?.youngs_modulus == null;
    this.radius.disabled = watching;
    this.model.disabled = watching;
  }
}

function rangeOf(modulus: number | null): Range {
  if (modulus === null || (modulus >= TISSUE[0] && modulus <= TISSUE[1])) return TISSUE;
  return [modulus / 10, modulus * 10];
}

/** What is told in place of a stiffness that cannot be changed. */
function fixedModulus({ scene, body }: Readonly<State>): string {
  const { motion } = scene!;
  return motion?.body === body && motion.youngs_modulus !== null
    ? `${pascals(motion.youngs_modulus)}, fixed`
    : "several materials";
}
