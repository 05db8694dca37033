// Screenshot of the scene with the legend, the force and the scale over it.

import type { Viewport } from "../scene/viewport";
import { byId, create } from "./dom";
import { themeColor } from "./theme";

/** What is written over the picture, but for notices and hints. */
const OVERLAY_IDS = ["readout", "legend", "scale", "scale-banner", "mode-banner"];

/** As PNG, null where the browser cannot. */
export function takePicture(viewport: Viewport): Promise<Blob | null> {
  const { canvas } = viewport;
  const picture = create("canvas");
  const context = picture.getContext("2d")!;
  // In one go: the browser may clear what it has shown.
  viewport.renderInFull(() => {
    [picture.width, picture.height] = [canvas.width, canvas.height];
    paintBackdrop(context, picture.width, picture.height);
    context.drawImage(canvas, 0, 0);
  });
  const { left, top, width } = canvas.getBoundingClientRect();
  const scale = picture.width / width;
  context.scale(scale, scale);
  context.translate(-left, -top);
  for (const id of OVERLAY_IDS) paint(context, byId(id));
  return new Promise((resolve) => picture.toBlob(resolve, "image/png"));
}

/** As the style of the page has it: a little lighter in the middle. */
function paintBackdrop(context: CanvasRenderingContext2D, width: number, height: number): void {
  const [x, y] = [0.5 * width, 0.56 * height];
  const gradient = context.createRadialGradient(x, y, 0, x, y, 0.75 * Math.max(width, height));
  gradient.addColorStop(0.04, themeColor("--backdrop-middle"));
  gradient.addColorStop(0.78, themeColor("--backdrop"));
  context.fillStyle = gradient;
  context.fillRect(0, 0, width, height);
}

/** Paints an element as it stands on the page, in its place, with all that is in it but buttons. */
function paint(context: CanvasRenderingContext2D, element: HTMLElement): void {
  const box = element.getBoundingClientRect();
  if (box.width === 0 || box.height === 0 || element instanceof HTMLButtonElement) return;
  const style = getComputedStyle(element);
  if (style.visibility === "hidden") return;
  paintBox(context, box, style);
  if (element instanceof HTMLCanvasElement) {
    context.drawImage(element, box.left, box.top, box.width, box.height);
    return;
  }
  if (element instanceof HTMLInputElement) return paintText(context, element.value, box, style, "right");
  for (const child of element.childNodes) {
    if (child instanceof HTMLElement) paint(context, child);
    else if (child instanceof Text) paintLines(context, child, style);
  }
}

function paintBox(context: CanvasRenderingContext2D, box: DOMRect, style: CSSStyleDeclaration): void {
  context.beginPath();
  if (style.transform !== "none" && new DOMMatrix(style.transform).b !== 0) {
    // A square that stands on its corner.
    context.moveTo(box.left, box.top + box.height / 2);
    context.lineTo(box.left + box.width / 2, box.top);
    context.lineTo(box.right, box.top + box.height / 2);
    context.lineTo(box.left + box.width / 2, box.bottom);
  } else {
    context.roundRect(box.left, box.top, box.width, box.height, Number.parseFloat(style.borderTopLeftRadius) || 0);
  }
  context.fillStyle = style.backgroundColor;
  context.fill();
  if (Number.parseFloat(style.borderTopWidth) === 0) return;
  context.strokeStyle = style.borderTopColor;
  context.lineWidth = Number.parseFloat(style.borderTopWidth);
  if (Number.parseFloat(style.borderBottomWidth) > 0) context.stroke();
  else context.strokeRect(box.left, box.top, box.width, 0);
}

/** A text that may run over several lines, each where the browser has broken it. */
function paintLines(context: CanvasRenderingContext2D, text: Text, style: CSSStyleDeclaration): void {
  const range = document.createRange();
  let [line, box]: [string, DOMRect | null] = ["", null];
  for (let i = 0; i < text.length; i++) {
    range.setStart(text, i);
    range.setEnd(text, i + 1);
    const letter = range.getBoundingClientRect();
    if (letter.width === 0) continue;
    if (box && letter.top > box.bottom - 1) {
      paintText(context, line, box, style, "left");
      [line, box] = ["", null];
    }
    line += text.data[i]!;
    box = box ? new DOMRect(box.left, box.top, letter.right - box.left, box.height) : letter;
  }
  if (box) paintText(context, line, box, style, "left");
}

function paintText(context: CanvasRenderingContext2D, text: string, box: DOMRect, style: CSSStyleDeclaration, align: "left" | "right"): void {
  context.font = style.font;
  context.letterSpacing = style.letterSpacing === "normal" ? "0px" : style.letterSpacing;
  context.fillStyle = style.color;
  context.textAlign = align;
  context.textBaseline = "middle";
  const inset = align === "right" ? Number.parseFloat(style.paddingRight) || 0 : 0;
  context.fillText(text, align === "left" ? box.left : box.right - inset, box.top + box.height / 2);
}

export function download(blob: Blob, sceneName: string): void {
  const stamp = new Date().toISOString().slice(0, 19).replaceAll(":", "").replace("T", "-");
  const link = create("a", { href: URL.createObjectURL(blob), download: `palpate-${sceneName}-${stamp}.png` });
  link.click();
  // The download has read the address by then.
  window.setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
