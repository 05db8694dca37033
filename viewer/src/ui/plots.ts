// Live plots: force against time and against depth; computing time of the loop; displacement and energy of a body in motion.

import type uPlot from "uplot";

import type { FrameData } from "../net/protocol";
import { shownTool } from "../store";
import type { Store, Tab } from "../store";
import { byId, designScale } from "./dom";
import { HistoryLog } from "./history_log";
import { LogWindow, WINDOW_S } from "./log_window";
import { HEIGHT_PX, createPlot } from "./plot";
import { PressLog } from "./press_log";

/** The eye does not follow faster, and every redraw costs the page time. */
const REDRAW_INTERVAL_MS = 80;
/** Above these stands what their lines mean. */
const MOTION_HEIGHT_PX = 108;
/** In a window lower than this plots give way by so much, or the statistics below would be out of sight. */
const LOW_WINDOW_PX = 920;
const LOWER_PX = 22;
/** Spans below these are noise, and would only dance: N, us, mm. */
const FORCE_SPAN_MIN = 0.1;
const DEPTH_SPAN_MIN = 1;
const COMPUTE_SPAN_MIN = 50;
const DISPLACEMENT_SPAN_MIN = 0.02;
/** Energies of soft bodies are small. */
const ENERGY_UNITS: [unit: string, joules: number][] = [
  ["J", 1],
  ["mJ", 1e-3],
  ["µJ", 1e-6],
  ["nJ", 1e-9],
];

export class Plots {
  readonly history = new HistoryLog();
  private readonly log = new LogWindow();
  private shown = true;
  /** Body time shown of a motion, s, and where it begins; null for what has just been. */
  private span = 1;
  private origin: number | null = null;
  private tab: Exclude<Tab, "modes"> = "force";
  private readonly press = new PressLog();
  private readonly plots: Record<"force" | "press" | "compute" | "displacement" | "energy", uPlot>;
  private drawnMs = 0;
  private driven: number | null = null;
  private restarts = 0;

  constructor(store: Store) {
    const recent = { range: (): [number, number] => [-WINDOW_S, 0], label: () => "time before now (s)" };
    const moved = {
      range: (): [number, number] => (this.origin === null ? [-this.span, 0] : [0, this.span]),
      label: () => (this.origin === null ? "body time before now (s)" : "body time since the strike (s)"),
    };
    const deep = {
      range: (): [number, number] => {
        const [low, high] = this.press.extent().depth;
        return [low, Math.max(low + DEPTH_SPAN_MIN, high + 0.05 * (high - low))];
      },
      label: () => "depth (mm)",
      round: true,
    };
    const forceRange = (): [number, number] => [0, Math.max(FORCE_SPAN_MIN, 1.15 * this.press.extent().force)];
    const trail = () => ({ along: this.press.depth, up: this.press.force });
    this.plots = {
      press: createPlot("plot-press", deep, "force (N)", ["--force"], forceRange, trail),
      force: createPlot("plot-force", recent, "force (N)", ["--force"], above(FORCE_SPAN_MIN)),
      compute: createPlot("plot-compute", recent, "per tick (µs)", ["--line-blue"], above(COMPUTE_SPAN_MIN)),
      displacement: createPlot("plot-displacement", moved, "mm", ["--line-red", "--line-green", "--line-blue"], around),
      energy: createPlot("plot-energy", moved, "energy (µJ)", ["--line-grey", "--line-violet", "--line-blue", "--force"], above(0)),
    };
    new ResizeObserver(() => this.resize()).observe(byId("plots"));
    this.follow(store);
  }

  /** Takes in what a frame carries, drawn or not. */
  append({ header, log, history }: FrameData): void {
    // A replay that went back makes rows again that were shown before.
    const restarts = header.replay?.restarts ?? 0;
    if (restarts !== this.restarts) {
      for (const rows of [this.log, this.press, this.history]) rows.clear();
      this.restarts = restarts;
    }
    this.log.append(log);
    this.press.append(header, this.driven);
    this.history.append(history);
  }

  private follow(store: Store): void {
    store.subscribe(["layers", "more"], ({ layers, more }) => (this.shown = layers.plots && more));
    store.subscribe(["scene"], ({ scene }) => {
      this.log.clear();
      this.press.clear();
      this.history.clear();
      this.span = scene?.motion?.span ?? 1;
      // The log of the loop is about the first tool.
      this.plots.force.axes[1]!.label = (scene?.tools.length ?? 1) > 1 ? "finger 1 (N)" : "force (N)";
    });
    store.subscribe(["tab"], ({ tab }) => {
      if (tab === "modes") return;
      this.tab = tab;
      for (const one of ["force", "loop", "motion"]) byId(`plots-${one}`).hidden = tab !== one;
      this.resize();
      this.refresh(true);
    });
    store.subscribe(["theme"], () => {
      for (const plot of Object.values(this.plots)) plot.redraw();
    });
    store.subscribe(["scene", "pressing", "pinned"], (state) => (this.driven = shownTool(state)));
    store.subscribe(["frame"], ({ frame, scene }) => {
      this.origin = scene?.motion?.strike ? (frame?.motion?.struck_at ?? null) : null;
      this.refresh();
    });
  }

  /** Draws what has arrived, if it is time. */
  private refresh(force = false): void {
    const nowMs = performance.now();
    if (!this.shown || (!force && nowMs - this.drawnMs < REDRAW_INTERVAL_MS)) return;
    this.drawnMs = nowMs;
    if (this.tab === "motion") return this.drawMotion();
    const { time, force: newtons, compute } = this.log.read();
    if (this.tab === "loop") return this.plots.compute.setData([time, compute]);
    this.plots.force.setData([time, newtons]);
    // Its line is drawn over it.
    this.plots.press.setData([this.press.extent().depth, [null, null]]);
  }

  private drawMotion(): void {
    const { time, displacement, kinetic, strain, total, supplied } = this.history.read(this.span, this.origin);
    this.plots.displacement.setData([time, ...displacement]);
    const largest = Math.max(1e-9, supplied.reduce((a, b) => Math.max(a, b), 0), total.reduce((a, b) => Math.max(a, b), 0));
    const [unit, joules] = ENERGY_UNITS.find(([, size]) => largest >= size) ?? ENERGY_UNITS.at(-1)!;
    this.plots.energy.axes[1]!.label = `energy (${unit})`;
    const energies = [supplied, kinetic, strain, total].map((column) => column.map((value) => value / joules));
    this.plots.energy.setData([time, ...energies]);
  }

  private resize(): void {
    const { displacement, energy } = this.plots;
    for (const plot of Object.values(this.plots)) {
      const width = plot.root.parentElement!.clientWidth;
      const tall = plot === displacement || plot === energy ? MOTION_HEIGHT_PX : HEIGHT_PX;
      const height = Math.round(designScale() * (window.innerHeight < LOW_WINDOW_PX ? tall - LOWER_PX : tall));
      if (width > 0 && width !== plot.width) plot.setSize({ width, height });
    }
  }
}

/** From zero up. */
function above(spanMin: number): uPlot.Scale.Range {
  return (_plot, _low, high) => [0, Math.max(spanMin, 1.15 * (high ?? 0)) || 1];
}

/** To both sides of zero. */
const around: uPlot.Scale.Range = (_plot, low, high) => {
  const largest = Math.max(DISPLACEMENT_SPAN_MIN, Math.abs(low ?? 0), Math.abs(high ?? 0));
  return [-1.15 * largest, 1.15 * largest];
};
