// The tool that is driven, or that the next press drives: its shape and how it is held, and the friction or the patch of its
// contacts.

import { TILT_MAX, firstPosture } from "../control";
import type { Control } from "../control";
import { shownTool } from "../store";
import type { State, Store } from "../store";
import { byId, list, showText } from "./dom";
import { degrees, millimetres } from "./numbers";
import { Slider } from "./slider";

const DEGREES = { "°": 1, deg: 1 };

export class ToolPanel {
  private readonly shape = byId<HTMLSelectElement>("shape");
  private readonly tilt: Slider;
  private readonly turn: Slider;
  private readonly friction: Slider;
  private readonly radius: Slider;

  constructor(store: Store, control: Control) {
    byId<HTMLInputElement>("tilt").max = String(TILT_MAX);
    this.shape.onchange = () => control.chooseShape(this.shape.value);
    const driven = () => shownTool(store.get()) ?? 0;
    const showError = (text: string) => control.notice(text);
    const posture = () => {
      const header = store.get().scene?.tools[driven()];
      return header ? firstPosture(header.shape) : null;
    };
    const angle = { format: degrees, units: DEGREES, usual: "°", showError };
    this.tilt = new Slider({ ...angle, id: "tilt", name: "Tilt", fallback: () => posture()?.tilt ?? null, choose: (tilt) => control.hold({ tilt }) });
    this.turn = new Slider({ ...angle, id: "turn", name: "Turn", fallback: () => posture()?.turn ?? null, choose: (turn) => control.hold({ turn }) });
    this.friction = new Slider({
      id: "friction",
      name: "Friction",
      format: (value) => value.toFixed(2),
      fallback: () => store.get().scene?.defaults.friction[driven()] ?? null,
      choose: (value) => control.setFriction(value),
      showError,
    });
    this.radius = new Slider({
      id: "radius",
      name: "Patch radius",
      format: millimetres,
      units: { mm: 1e-3, cm: 1e-2, m: 1 },
      usual: "mm",
      fallback: () => store.get().scene?.defaults.contact_radius[driven()] ?? null,
      choose: (value) => control.setContactRadius(value),
      showError,
    });
    store.subscribe(["scene", "settings", "pinned", "pressing"], (state) => this.showContact(state));
    store.subscribe(["scene", "settings", "pinned", "pressing", "status"], (state) => this.showShape(state));
    store.subscribe(["scene", "postures", "pinned", "pressing"], (state) => this.showPosture(state));
    store.subscribe(["scene"], ({ scene }) => showDevices(scene?.tools.map(({ device }) => device) ?? []));
    store.subscribe(["role"], ({ role }) => {
      const { shape, tilt, turn, friction, radius } = this;
      for (const input of [shape, tilt, turn, friction, radius]) input.disabled = role !== "control";
    });
  }

  private showShape(state: Readonly<State>): void {
    const tool = shownTool(state) ?? 0;
    const header = state.scene?.tools[tool];
    if (!header) return;
    byId("shape-row").hidden = header.shapes.length < 2;
    list(this.shape, header.shapes);
    // One that was cancelled is not the one that the tool has.
    if (!state.status?.text) this.shape.value = state.settings?.shape[tool] ?? header.shape;
  }

  /** A sphere is the same from all sides. */
  private showPosture(state: Readonly<State>): void {
    const tool = shownTool(state) ?? 0;
    const [header, posture] = [state.scene?.tools[tool], state.postures[tool]];
    for (const id of ["tilt-field", "turn-field"]) byId(id).hidden = !header || header.shape === "sphere";
    if (!posture) return;
    this.tilt.show(posture.tilt);
    this.turn.show(posture.turn);
  }

  private showContact(state: Readonly<State>): void {
    const tool = shownTool(state) ?? 0;
    const [header, { settings }] = [state.scene?.tools[tool], state];
    if (!header || !settings) return;
    byId("friction-field").hidden = header.contact !== "local";
    byId("radius-field").hidden = header.contact === "local";
    this.friction.show(settings.friction[tool] ?? 0);
    this.radius.input.max = String(header.max_contact_radius);
    this.radius.input.step = String(header.max_contact_radius / 200);
    this.radius.show(settings.contact_radius[tool] ?? 0);
  }
}

/** Which devices move which tools. */
function showDevices(devices: (string | null)[]): void {
  const moved = devices.flatMap((device, tool) => (device === null ? [] : [{ device, tool }]));
  // It tells how the pointer presses.
  if (devices.length > 0 && moved.length === devices.length) byId("hint").hidden = true;
  const several = devices.length > 1;
  const lines = moved.map(({ device, tool }) => (several ? `Tool ${tool + 1}: ${device}` : `Moved by ${device}`));
  showText(byId("device-line"), moved.length > 0 ? lines.join(". ") : null);
}
