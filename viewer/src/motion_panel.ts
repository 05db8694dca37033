// Controls of a body in motion: blows, slow motion, mode shapes, and which plots are shown.

import { byId, setText } from "./dom";
import { hertz, newtonSeconds } from "./numbers";
import type { PlotPair } from "./plots";
import type { ClientMessage, ModeMessage, MotionScene, Role } from "./protocol";

/** The slider begins at this part of the strongest blow. */
const WEAKEST = 1e-3;
const TIME_SCALES: [id: string, scale: number][] = [
  ["speed-1", 1],
  ["speed-4", 1 / 4],
  ["speed-10", 1 / 10],
];
type Tab = PlotPair | "modes";
const TABS: Tab[] = ["motion", "loop", "modes"];

export interface MotionHandlers {
  send(message: ClientMessage): void;
  onPlots(pair: PlotPair): void;
}

export class MotionPanel {
  /** Whether a click strikes. */
  strike = false;
  private scene: MotionScene | null = null;
  private role: Role = "watch";
  private mode = 0;
  private readonly impulseSlider = byId<HTMLInputElement>("impulse");
  private readonly modeList = byId("mode-list");

  constructor(private readonly handlers: MotionHandlers) {
    byId("strike").onclick = () => this.toggleStrike();
    byId("repeat").onclick = () => handlers.send({ type: "repeat" });
    byId("mode-close").onclick = () => this.endMode();
    this.impulseSlider.oninput = () => setText(byId("impulse-value"), newtonSeconds(this.impulse));
    for (const [id, scale] of TIME_SCALES) byId(id).onclick = () => handlers.send({ type: "set", time_scale: scale });
    for (const tab of TABS) byId(`tab-${tab}`).onclick = () => this.showTab(tab);
  }

  /** Size of the next blow, N s. */
  get impulse(): number {
    const strongest = this.scene?.max_impulse ?? 0;
    return strongest * WEAKEST ** (1 - this.impulseSlider.valueAsNumber);
  }

  setScene(scene: MotionScene | null): void {
    this.scene = scene;
    if (!scene && this.strike) this.toggleStrike();
    for (const id of ["motion", "tabs", "hint-strike"]) byId(id).hidden = !scene;
    byId("panel").classList.toggle("moving", scene !== null);
    byId("repeat").hidden = !scene?.strike;
    this.showTab(scene ? "motion" : "loop");
    this.showMode(null);
    if (!scene) return;
    this.impulseSlider.valueAsNumber = 1 - Math.log(scene.impulse / scene.max_impulse) / Math.log(WEAKEST);
    setText(byId("impulse-value"), newtonSeconds(this.impulse));
    this.setTimeScale(scene.time_scale);
    setText(byId("mode-count"), `the first ${scene.frequencies.length} of ${scene.modes}`);
    this.modeList.replaceChildren(...scene.frequencies.map((frequency, i) => this.modeButton(i + 1, frequency)));
    this.enable();
  }

  setRole(role: Role): void {
    this.role = role;
    if (role === "watch" && this.strike) this.toggleStrike();
    this.enable();
  }

  setTimeScale(timeScale: number | null): void {
    for (const [id, scale] of TIME_SCALES) {
      const chosen = timeScale !== null && Math.abs(timeScale - scale) < 1e-6;
      byId(id).setAttribute("aria-pressed", String(chosen));
    }
  }

  toggleStrike(): void {
    if (!this.strike && (this.role !== "control" || !this.scene)) return;
    this.strike = !this.strike;
    byId("strike").setAttribute("aria-pressed", String(this.strike));
  }

  /** What the server says is drawn. */
  showMode(mode: ModeMessage | null): void {
    const chosen = mode?.number ?? 0;
    if (chosen === this.mode) return;
    this.mode = chosen;
    [...this.modeList.children].forEach((button, i) => button.setAttribute("aria-pressed", String(i + 1 === chosen)));
    byId("mode-banner").hidden = !mode;
    if (!mode) return;
    const pace = mode.frequency > mode.shown_hz ? "slowed" : "sped up";
    const swing = `${(1000 * mode.amplitude).toPrecision(2)} mm`;
    setText(byId("mode-text"), `Mode ${mode.number}: ${hertz(mode.frequency)}, shown ${pace}`);
    setText(byId("mode-detail"), `${mode.shown_hz} Hz here, swing ${swing}`);
  }

  endMode(): void {
    if (this.mode > 0 && this.role === "control") this.handlers.send({ type: "mode", number: 0 });
  }

  private showTab(tab: Tab): void {
    for (const other of TABS) byId(`tab-${other}`).setAttribute("aria-pressed", String(other === tab));
    byId("modes").hidden = tab !== "modes";
    byId("plot-pairs").hidden = tab === "modes";
    // Room for what belongs to the motion; the loop's timing stands below the loop's plots.
    byId("statistics").hidden = tab !== "loop";
    if (tab !== "modes") this.handlers.onPlots(tab);
  }

  private modeButton(number: number, frequency: number): HTMLButtonElement {
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("aria-pressed", "false");
    button.setAttribute("aria-label", `Mode ${number}, ${hertz(frequency)}`);
    const rank = document.createElement("small");
    rank.textContent = String(number);
    button.append(rank, hertz(frequency));
    // The mode that is shown ends at a second click.
    button.onclick = () => this.handlers.send({ type: "mode", number: number === this.mode ? 0 : number });
    return button;
  }

  private enable(): void {
    const watching = this.role !== "control";
    const buttons = [...byId("motion").querySelectorAll("button"), ...this.modeList.querySelectorAll("button")];
    for (const control of [...buttons, byId<HTMLButtonElement>("mode-close")]) control.disabled = watching;
    this.impulseSlider.disabled = watching;
  }
}
