// Controls of a body in motion: strikes, slow motion, mode shapes, and which plots are shown.

import type { Control } from "../control";
import type { ModeMessage, MotionScene } from "../net/protocol";
import type { Store, Tab } from "../store";
import { byId, create, press, setText } from "./dom";
import { hertz, newtonSeconds } from "./numbers";
import { Slider } from "./slider";

/** The slider begins at this part of the strongest impulse. */
const WEAKEST = 1e-3;
const TIME_SCALES: [id: string, scale: number][] = [
  ["speed-1", 1],
  ["speed-4", 1 / 4],
  ["speed-10", 1 / 10],
];
const TABS: Tab[] = ["motion", "force", "loop", "modes"];

export class MotionPanel {
  private readonly impulse: Slider;
  private readonly modeList = byId("mode-list");

  constructor(private readonly store: Store, private readonly control: Control) {
    byId("strike").onclick = () => control.toggleStrike();
    byId("repeat").onclick = () => control.repeatStrike();
    byId("mode-close").onclick = () => control.showMode(0);
    this.impulse = impulseSlider(store, control);
    for (const [id, scale] of TIME_SCALES) byId(id).onclick = () => control.setTimeScale(scale);
    for (const tab of TABS) byId(`tab-${tab}`).onclick = () => store.update({ tab });
    this.follow();
  }

  private follow(): void {
    const { store } = this;
    store.subscribe(["scene"], ({ scene }) => this.setMotion(scene?.motion ?? null));
    store.subscribe(["scene", "impulse"], ({ scene, impulse }) => {
      if (scene?.motion) this.impulse.show(impulse);
    });
    store.subscribe(["strike"], ({ strike }) => press("strike", strike));
    store.subscribe(["settings"], ({ settings }) => {
      const chosen = settings?.time_scale ?? null;
      for (const [id, scale] of TIME_SCALES) press(id, chosen !== null && Math.abs(chosen - scale) < 1e-6);
    });
    store.subscribe(["tab"], ({ tab }) => {
      for (const other of TABS) press(`tab-${other}`, other === tab);
      byId("modes").hidden = tab !== "modes";
      byId("plot-pairs").hidden = tab === "modes";
      // Room for what belongs to the motion; the loop's timing stands below the loop's plots.
      byId("statistics").hidden = tab === "motion" || tab === "modes";
    });
    let shown = 0;
    store.subscribe(["frame"], ({ frame }) => {
      const mode = frame?.motion?.mode ?? null;
      if ((mode?.number ?? 0) === shown) return;
      shown = mode?.number ?? 0;
      this.showMode(mode);
    });
    store.subscribe(["role", "scene"], ({ role }) => {
      const watching = role !== "control";
      const buttons = [...byId("motion").querySelectorAll("button"), ...this.modeList.querySelectorAll("button")];
      for (const button of [...buttons, byId<HTMLButtonElement>("mode-close")]) button.disabled = watching;
      this.impulse.disabled = watching;
    });
  }

  private setMotion(motion: MotionScene | null): void {
    for (const id of ["motion", "tab-motion", "tab-modes"]) byId(id).hidden = !motion;
    byId("repeat").hidden = !motion?.strike;
    if (!motion) return;
    setText(byId("mode-count"), `the first ${motion.frequencies.length} of ${motion.modes}`);
    this.modeList.replaceChildren(...motion.frequencies.map((frequency, i) => this.modeButton(i + 1, frequency)));
  }

  /** What the server says is drawn. */
  private showMode(mode: ModeMessage | null): void {
    const buttons = [...this.modeList.children];
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i + 1 === mode?.number)));
    byId("mode-banner").hidden = !mode;
    if (!mode) return;
    const pace = mode.frequency > mode.shown_hz ? "slowed" : "sped up";
    const swing = `${(1000 * mode.amplitude).toPrecision(2)} mm`;
    setText(byId("mode-text"), `Mode ${mode.number}: ${hertz(mode.frequency)}, shown ${pace}`);
    setText(byId("mode-detail"), `${mode.shown_hz} Hz here, swing ${swing}`);
  }

  private modeButton(number: number, frequency: number): HTMLButtonElement {
    const onclick = () => this.control.showMode(number);
    const named = { ariaPressed: "false", ariaLabel: `Mode ${number}, ${hertz(frequency)}` };
    return create("button", { type: "button", ...named, onclick }, create("small", {}, String(number)), hertz(frequency));
  }
}

function impulseSlider(store: Store, control: Control): Slider {
  const strongest = () => store.get().scene?.motion?.max_impulse ?? 0;
  return new Slider({
    id: "impulse",
    name: "Impulse of a strike",
    format: newtonSeconds,
    units: { "N s": 1, "mN s": 1e-3, "µN s": 1e-6 },
    scale: {
      toTrack: (impulse) => 1 - Math.log(impulse / strongest()) / Math.log(WEAKEST),
      fromTrack: (place) => strongest() * WEAKEST ** (1 - place),
    },
    bounds: () => [WEAKEST * strongest(), strongest()],
    fallback: () => store.get().scene?.motion?.impulse ?? null,
    choose: (impulse) => store.update({ impulse }),
    showError: (text) => control.notice(text),
  });
}
