// Style and construction of plots.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

import { byId, designScale } from "./dom";
import { themeColor } from "./theme";

export const HEIGHT_PX = 112;
const FONT_PX = 11;
const TEXT_COLOR = () => themeColor("--muted");
const GRID = { stroke: () => themeColor("--grid"), width: 1 };
/** A colour of style.css, in the theme of the moment. */
export type LineColor = `--${string}`;

/** What lies along the plot: its range now, what is written below, and whether uPlot chooses round numbers or fifths are told. */
export interface AxisRange {
  range(): [number, number];
  label(): string;
  round?: boolean;
}

/** A line that may turn back, drawn over a plot: its points now, along and up, in the plot's units. */
export type Trail = () => { along: readonly number[]; up: readonly number[] };

export function createPlot(id: string, along: AxisRange, label: string, colors: LineColor[], range: uPlot.Scale.Range, trail?: Trail): uPlot {
  const box = byId(id);
  const scale = designScale();
  // Whole pixels: uPlot scales the number for dense screens and does not read a fraction.
  const font = `${Math.round(FONT_PX * scale)}px system-ui, sans-serif`;
  const axis = { font, labelFont: font, stroke: TEXT_COLOR, grid: GRID, ticks: { ...GRID, size: 4 }, gap: 3 };
  const fifths = {
    splits: () => fifthsOf(...along.range()),
    values: (_plot: uPlot, splits: number[]) => splits.map((split) => String(Number(Math.abs(split).toPrecision(3)))),
  };
  const options: uPlot.Options = {
    width: 0,
    height: scale * HEIGHT_PX,
    padding: [8, 10, 0, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, range: () => along.range() }, y: { range } },
    axes: [
      { ...axis, size: 17 * scale, label: along.label(), labelSize: 13 * scale, labelGap: 0, ...(along.round ? { space: 30 } : fifths) },
      { ...axis, size: 38 * scale, space: 20 * scale, label, labelSize: 14 * scale, labelGap: 0 },
    ],
    series: [{}, ...colors.map((color) => ({ stroke: () => themeColor(color), width: 1.25, points: { show: false } }))],
    hooks: {
      drawClear: [(plot) => void (plot.axes[0]!.label = along.label())],
      draw: trail ? [(plot) => drawTrail(plot, trail, themeColor(colors[0]!))] : [],
    },
  };
  const nothing = [[], ...colors.map(() => [])] as unknown as uPlot.AlignedData;
  return new uPlot(options, nothing, box);
}

/** uPlot's own lines go from left to right; this one goes as its points do, and ends in a dot. */
function drawTrail(plot: uPlot, trail: Trail, color: string): void {
  const { along, up } = trail();
  if (along.length === 0) return;
  const { ctx, bbox } = plot;
  const place = (i: number) => [plot.valToPos(along[i]!, "x", true), plot.valToPos(up[i]!, "y", true)] as const;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.beginPath();
  for (let i = 0; i < along.length; i++) ctx.lineTo(...place(i));
  ctx.strokeStyle = ctx.fillStyle = color;
  ctx.lineWidth = 1.25 * uPlot.pxRatio;
  ctx.stroke();
  ctx.beginPath();
  ctx.arc(...place(along.length - 1), 3 * uPlot.pxRatio, 0, 2 * Math.PI);
  ctx.fill();
  ctx.restore();
}

function fifthsOf(low: number, high: number): number[] {
  return Array.from({ length: 6 }, (_, i) => low + ((high - low) * i) / 5);
}
