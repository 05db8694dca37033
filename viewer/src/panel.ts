// The controls: model, stiffness, contact radius, what is shown, and the buttons.

import type { Shown } from "./body_view";
import type { Axis } from "./cut_plane";
import { byId, setText } from "./dom";
import type { ClientMessage, Role, SceneMessage } from "./protocol";
import { RateLimit } from "./rate_limit";

/** A slider dragged quickly sends no more often than this. */
const SEND_INTERVAL_MS = 40;
/** The usual range of soft tissue, Pa; a body outside it gets a decade to each side of its own value. */
const TISSUE_MIN = 1e3;
const TISSUE_MAX = 100e3;
/** For so long after the user moved a slider, values from the server do not move it back. */
const OWN_VALUE_MS = 400;
const AXES: Axis[] = ["x", "y", "z"];

export interface PanelHandlers {
  send(message: ClientMessage): void;
  onShown(shown: Shown & { plots: boolean }): void;
  onField(name: string): void;
  onCutaway(on: boolean): void;
  onCut(axis: Axis, share: number): void;
  onContactRadius(radius: number): void;
  onReset(): void;
  onResetView(): void;
  onScreenshot(): void;
}

export class Panel {
  readonly shown = { colors: true, wireframe: true, supports: true, cutaway: false, plots: true };
  grab = false;
  private cutAxis: Axis = "y";
  private role: Role = "watch";
  /** What is told in place of a stiffness that cannot be changed. */
  private fixedModulus = "several materials";
  private modulusRange: [number, number] | null = null;
  private changedMs = -Infinity;
  private readonly model = byId<HTMLSelectElement>("model");
  private readonly field = byId<HTMLSelectElement>("field");
  private readonly stiffness = byId<HTMLInputElement>("stiffness");
  private readonly radius = byId<HTMLInputElement>("radius");
  private readonly cutShare = byId<HTMLInputElement>("cut-share");
  private readonly sendStiffness: RateLimit;
  private readonly sendRadius: RateLimit;

  constructor(private readonly handlers: PanelHandlers) {
    const { send } = handlers;
    this.sendStiffness = new RateLimit(SEND_INTERVAL_MS, () => send({ type: "set", youngs_modulus: this.modulus() }));
    this.sendRadius = new RateLimit(SEND_INTERVAL_MS, () =>
      send({ type: "set", contact_radius: this.radius.valueAsNumber }),
    );
    this.listenToSliders();
    for (const name of ["colors", "wireframe", "supports", "cutaway", "plots"] as const) {
      byId(`show-${name}`).onclick = () => this.toggle(name);
    }
    this.field.onchange = () => this.chooseField(this.field.value);
    byId("grab").onclick = () => this.toggleGrab();
    for (const axis of AXES) byId(`cut-${axis}`).onclick = () => this.cutAcross(axis);
    this.cutShare.oninput = () => handlers.onCut(this.cutAxis, this.cutShare.valueAsNumber);
    byId("reset").onclick = () => handlers.onReset();
    byId("fault-reset").onclick = () => handlers.onReset();
    byId("reset-view").onclick = () => handlers.onResetView();
    byId("screenshot").onclick = () => handlers.onScreenshot();
    byId("sheet-toggle").onclick = () => toggleSheet();
  }

  setModels(models: { name: string; title: string }[]): void {
    byId("model-row").hidden = models.length === 0;
    this.model.replaceChildren(...models.map(({ name, title }) => new Option(title, name)));
  }

  setRole(role: Role): void {
    this.role = role;
    this.enable();
  }

  setScene(scene: SceneMessage): void {
    this.model.value = scene.name;
    const chosen = this.field.value;
    this.field.replaceChildren(...scene.fields.map(({ name, title }) => new Option(title, name)));
    // The field of the body before, if this one has it too.
    if (scene.fields.some(({ name }) => name === chosen)) this.field.value = chosen;
    this.radius.max = String(scene.max_contact_radius);
    this.radius.step = String(scene.max_contact_radius / 200);
    const modulus = scene.youngs_modulus;
    const usual = modulus !== null && modulus >= TISSUE_MIN && modulus <= TISSUE_MAX;
    if (modulus === null) this.modulusRange = null;
    else this.modulusRange = usual ? [TISSUE_MIN, TISSUE_MAX] : [modulus / 10, modulus * 10];
    const moving = scene.motion?.youngs_modulus;
    this.fixedModulus = moving == null ? "several materials" : `${pascals(moving)}, fixed`;
    byId("stiffness-field").title = scene.motion ? "The modes of a body in motion belong to its stiffness" : "";
    this.changedMs = -Infinity;
    // A bare store has no tetrahedra to be shown.
    const solid = scene.tets > 0;
    if (!solid && this.shown.cutaway) this.toggle("cutaway");
    byId<HTMLButtonElement>("show-cutaway").disabled = !solid;
    this.setSettings(modulus, scene.contact_radius);
    this.enable();
  }

  setSettings(modulus: number | null, contactRadius: number): void {
    if (performance.now() - this.changedMs < OWN_VALUE_MS) return;
    if (modulus !== null && this.modulusRange) {
      const [low, high] = this.modulusRange;
      this.stiffness.valueAsNumber = Math.log(modulus / low) / Math.log(high / low);
    }
    this.radius.valueAsNumber = contactRadius;
    setText(byId("stiffness-value"), modulus === null ? this.fixedModulus : pascals(modulus));
    setText(byId("radius-value"), millimetres(contactRadius));
  }

  toggle(name: keyof Panel["shown"]): void {
    if (byId<HTMLButtonElement>(`show-${name}`).disabled && !this.shown[name]) return;
    this.shown[name] = !this.shown[name];
    byId(`show-${name}`).setAttribute("aria-pressed", String(this.shown[name]));
    if (name === "cutaway") {
      byId("cut").hidden = !this.shown.cutaway;
      this.handlers.onCutaway(this.shown.cutaway);
    }
    if (name === "plots") byId("plots").hidden = !this.shown.plots;
    this.handlers.onShown(this.shown);
  }

  /** The next field, after the last one the first. */
  nextField(): void {
    const { options } = this.field;
    if (options.length > 0) this.chooseField(options[(this.field.selectedIndex + 1) % options.length]!.value);
  }

  toggleGrab(): void {
    if (this.role !== "control") return;
    this.grab = !this.grab;
    byId("grab").setAttribute("aria-pressed", String(this.grab));
  }

  /** Takes away the side towards the viewer. */
  cutAcross(axis: Axis): void {
    this.cutAxis = axis;
    for (const other of AXES) byId(`cut-${other}`).setAttribute("aria-pressed", String(other === axis));
    this.handlers.onCut(axis, this.cutShare.valueAsNumber);
  }

  /** A field that is chosen wants to be seen. */
  private chooseField(name: string): void {
    this.field.value = name;
    if (!this.shown.colors) this.toggle("colors");
    this.handlers.onField(name);
  }

  private listenToSliders(): void {
    this.stiffness.oninput = () => {
      this.changedMs = performance.now();
      setText(byId("stiffness-value"), pascals(this.modulus()));
      this.sendStiffness.request();
    };
    this.radius.oninput = () => {
      this.changedMs = performance.now();
      setText(byId("radius-value"), millimetres(this.radius.valueAsNumber));
      this.handlers.onContactRadius(this.radius.valueAsNumber);
      this.sendRadius.request();
    };
    this.model.onchange = () => this.handlers.send({ type: "model", name: this.model.value });
  }

  private modulus(): number {
    const [low, high] = this.modulusRange ?? [TISSUE_MIN, TISSUE_MAX];
    return low * (high / low) ** this.stiffness.valueAsNumber;
  }

  private enable(): void {
    const watching = this.role !== "control";
    this.stiffness.disabled = watching || this.modulusRange === null;
    this.radius.disabled = watching;
    this.model.disabled = watching;
    for (const id of ["reset", "fault-reset", "grab"]) byId<HTMLButtonElement>(id).disabled = watching;
  }
}

/** On a small screen the controls are a sheet that can be folded away. */
function toggleSheet(): void {
  const folded = byId("panel").classList.toggle("folded");
  const button = byId("sheet-toggle");
  button.setAttribute("aria-expanded", String(!folded));
  setText(button, folded ? "Show" : "Hide");
}

function pascals(value: number): string {
  if (value >= 0.9995e6) return `${(value / 1e6).toPrecision(3)} MPa`;
  if (value >= 0.9995e3) return `${(value / 1e3).toPrecision(3)} kPa`;
  return `${value.toPrecision(3)} Pa`;
}

function millimetres(metres: number): string {
  return `${(1000 * metres).toFixed(1)} mm`;
}
