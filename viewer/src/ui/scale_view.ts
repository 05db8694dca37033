// Axes of the scene and a scale bar of a round length, in a corner of the picture.

import * as THREE from "three";

import type { Viewport } from "../scene/viewport";
import type { Store } from "../store";
import { byId, designScale } from "./dom";
import { lengthText } from "./numbers";
import { themeColor } from "./theme";

/** Pixels of the design. */
const BAR_MAX = 104;
const BAR_TOP = 92;
const AXIS_LENGTH = 26;
const AXES_CENTRE = { x: 36, y: 44 };
const AXES: [name: string, direction: THREE.Vector3, color: `--${string}`][] = [
  ["x", new THREE.Vector3(1, 0, 0), "--line-red"],
  ["y", new THREE.Vector3(0, 1, 0), "--line-green"],
  ["z", new THREE.Vector3(0, 0, 1), "--line-blue"],
];

/** The longest of 1, 2 and 5 times a power of ten that is not above a length. */
export function roundLength(longest: number): number {
  const decade = 10 ** Math.floor(Math.log10(longest));
  const digit = [5, 2, 1].find((one) => one * decade <= longest * (1 + 1e-9)) ?? 1;
  return digit * decade;
}

export class ScaleView {
  private readonly canvas = byId<HTMLCanvasElement>("scale");

  constructor(private readonly viewport: Viewport, store: Store) {
    viewport.onView(() => this.draw());
    store.subscribe(["scene", "theme"], () => this.draw());
  }

  private draw(): void {
    const { canvas, viewport } = this;
    // The bar is true at the depth of the point that the view turns about.
    const metresPerPixel = viewport.metresPerPixel(viewport.controls.target);
    if (canvas.clientWidth === 0 || !(metresPerPixel > 0)) return;
    const scale = designScale();
    const length = roundLength(BAR_MAX * scale * metresPerPixel);
    canvas.setAttribute("aria-label", `Axes of the scene, and a scale bar of ${lengthText(length)}`);
    canvas.dataset["metres"] = String(length);
    canvas.dataset["pixels"] = String(length / metresPerPixel);
    const ratio = window.devicePixelRatio;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    const context = canvas.getContext("2d")!;
    context.scale(ratio * scale, ratio * scale);
    drawAxes(context, viewport.camera);
    drawBar(context, length / metresPerPixel / scale, lengthText(length));
  }
}

/** The axes that point away first: the others are drawn over them. */
function drawAxes(context: CanvasRenderingContext2D, camera: THREE.Camera): void {
  const seen = camera.quaternion.clone().invert();
  const { x, y } = AXES_CENTRE;
  const turned = AXES.map(([name, direction, color]) => ({ name, color, end: direction.clone().applyQuaternion(seen) }));
  turned.sort((a, b) => a.end.z - b.end.z);
  context.lineWidth = 2;
  context.lineCap = "round";
  context.font = "600 11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const { name, color, end } of turned) {
    context.strokeStyle = context.fillStyle = themeColor(color);
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + AXIS_LENGTH * end.x, y - AXIS_LENGTH * end.y);
    context.stroke();
    const letter = AXIS_LENGTH + 8;
    context.fillText(name, x + letter * end.x, y - letter * end.y);
  }
}

function drawBar(context: CanvasRenderingContext2D, width: number, label: string): void {
  const left = 10;
  context.strokeStyle = context.fillStyle = themeColor("--text");
  context.lineWidth = 1.5;
  context.lineCap = "butt";
  context.beginPath();
  context.moveTo(left, BAR_TOP);
  context.lineTo(left, BAR_TOP + 6);
  context.lineTo(left + width, BAR_TOP + 6);
  context.lineTo(left + width, BAR_TOP);
  context.stroke();
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "bottom";
  context.fillText(label, left + 4, BAR_TOP + 4);
}
