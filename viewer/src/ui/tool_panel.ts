// The tool that is driven, or that the next press drives: its shape and how it is held, and the friction or the patch of its
// contacts.

import { TILT_MAX } from "../control";
import type { Control } from "../control";
import { drivenTool } from "../store";
import type { State, Store } from "../store";
import { byId, setText } from "./dom";
import { degrees, millimetres } from "./numbers";

export class ToolPanel {
  private readonly shape = byId<HTMLSelectElement>("shape");
  private readonly tilt = byId<HTMLInputElement>("tilt");
  private readonly turn = byId<HTMLInputElement>("turn");
  private readonly friction = byId<HTMLInputElement>("friction");
  private readonly radius = byId<HTMLInputElement>("radius");

  constructor(store: Store, control: Control) {
    this.tilt.max = String(TILT_MAX);
    this.shape.onchange = () => control.chooseShape(this.shape.value);
    this.tilt.oninput = () => control.hold({ tilt: this.tilt.valueAsNumber });
    this.turn.oninput = () => control.hold({ turn: this.turn.valueAsNumber });
    this.friction.oninput = () => control.setFriction(this.friction.valueAsNumber);
    this.radius.oninput = () => control.setContactRadius(this.radius.valueAsNumber);
    store.subscribe(["scene", "settings", "pinned", "pressing"], (state) => this.showContact(state));
    store.subscribe(["scene", "settings", "pinned", "pressing", "status"], (state) => this.showShape(state));
    store.subscribe(["scene", "postures", "pinned", "pressing"], (state) => this.showPosture(state));
    store.subscribe(["role"], ({ role }) => {
      const { shape, tilt, turn, friction, radius } = this;
      for (const input of [shape, tilt, turn, friction, radius]) input.disabled = role !== "control";
    });
  }

  private showShape(state: Readonly<State>): void {
    const tool = drivenTool(state) ?? 0;
    const header = state.scene?.tools[tool];
    if (!header) return;
    byId("shape-row").hidden = header.shapes.length < 2;
    const listed = [...this.shape.options].map(({ value }) => value);
    if (listed.join() !== header.shapes.map(({ name }) => name).join()) {
      this.shape.replaceChildren(...header.shapes.map(({ name, title }) => new Option(title, name)));
    }
    // One that was cancelled is not the one that the tool has.
    if (!state.status?.text) this.shape.value = state.settings?.shape[tool] ?? header.shape;
  }

  /** A sphere is the same from all sides. */
  private showPosture(state: Readonly<State>): void {
    const tool = drivenTool(state) ?? 0;
    const [header, posture] = [state.scene?.tools[tool], state.postures[tool]];
    for (const id of ["tilt-field", "turn-field", "hint-turn"]) byId(id).hidden = !header || header.shape === "sphere";
    if (!posture) return;
    this.tilt.valueAsNumber = posture.tilt;
    this.turn.valueAsNumber = posture.turn;
    setText(byId("tilt-value"), degrees(posture.tilt));
    setText(byId("turn-value"), degrees(posture.turn));
  }

  private showContact(state: Readonly<State>): void {
    const tool = drivenTool(state) ?? 0;
    const [header, { settings }] = [state.scene?.tools[tool], state];
    if (!header || !settings) return;
    byId("friction-field").hidden = header.contact !== "local";
    byId("radius-field").hidden = header.contact === "local";
    const friction = settings.friction[tool] ?? 0;
    this.friction.valueAsNumber = friction;
    setText(byId("friction-value"), friction.toFixed(2));
    const radius = settings.contact_radius[tool] ?? 0;
    this.radius.max = String(header.max_contact_radius);
    this.radius.step = String(header.max_contact_radius / 200);
    this.radius.valueAsNumber = radius;
    setText(byId("radius-value"), millimetres(radius));
  }
}
