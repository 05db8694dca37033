// Force and computing time against time, live.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

import { LogWindow, WINDOW_S } from "./log_window";

/** The eye does not follow faster, and every redraw costs the page time. */
const REDRAW_INTERVAL_MS = 80;
const HEIGHT_PX = 112;
// Whole pixels: uPlot scales the number for dense screens and does not read a fraction.
const FONT = "11px system-ui, sans-serif";
const TEXT_COLOR = "#9aa5b4";
const GRID = { stroke: "#2a303a", width: 1 };
/** Spans below these are noise, and would only dance: N, and us. */
const FORCE_SPAN_MIN = 0.5;
const COMPUTE_SPAN_MIN = 50;

export class Plots {
  readonly log = new LogWindow();
  shown = true;
  private readonly force: uPlot;
  private readonly compute: uPlot;
  private drawnMs = 0;

  constructor(private readonly forceBox: HTMLElement, private readonly computeBox: HTMLElement) {
    this.force = createPlot(forceBox, "force (N)", "#ffb454", FORCE_SPAN_MIN);
    this.compute = createPlot(computeBox, "per tick (µs)", "#6fc3ff", COMPUTE_SPAN_MIN);
    new ResizeObserver(() => this.resize()).observe(forceBox);
  }

  /** Draws what has arrived, if it is time. */
  refresh(force = false): void {
    const nowMs = performance.now();
    if (!this.shown || (!force && nowMs - this.drawnMs < REDRAW_INTERVAL_MS)) return;
    this.drawnMs = nowMs;
    const { time, force: newtons, compute } = this.log.read();
    this.force.setData([time, newtons]);
    this.compute.setData([time, compute]);
  }

  private resize(): void {
    for (const [plot, box] of [
      [this.force, this.forceBox],
      [this.compute, this.computeBox],
    ] as const) {
      if (box.clientWidth > 0) plot.setSize({ width: box.clientWidth, height: HEIGHT_PX });
    }
  }
}

function createPlot(box: HTMLElement, label: string, color: string, spanMin: number): uPlot {
  const axis = { font: FONT, labelFont: FONT, stroke: TEXT_COLOR, grid: GRID, ticks: { ...GRID, size: 4 }, gap: 3 };
  const options: uPlot.Options = {
    width: box.clientWidth || 268,
    height: HEIGHT_PX,
    padding: [8, 6, 0, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: () => [-WINDOW_S, 0] },
      y: { range: (_plot, _low, high) => [0, Math.max(spanMin, 1.15 * (high ?? 0))] },
    },
    axes: [
      {
        ...axis,
        size: 17,
        label: "time before now (s)",
        labelSize: 13,
        labelGap: 0,
        splits: () => [-10, -8, -6, -4, -2, 0],
        values: (_plot, splits) => splits.map((split) => String(-split)),
      },
      { ...axis, size: 38, space: 24, label, labelSize: 14, labelGap: 0 },
    ],
    series: [{}, { stroke: color, width: 1.25, points: { show: false } }],
  };
  return new uPlot(options, [[], []], box);
}
