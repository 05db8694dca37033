// How dark the ground below a body is: what is seen of the sky from there. A place is dark where the body is just above it,
// and the shadow is wider and fainter the higher the body stands.

import { Box3 } from "three";

/** Texels along a side: soft shadows need no more. */
const TEXELS = 96;
/** Room around the body for the edge of the shadow, over its longer side on the ground. */
const ROOM = 0.3;
/** Over the longer side on the ground: at this height above it a body darkens 1/e of what it does where it stands. */
const FADING_HEIGHT = 0.3;
/** How dark the ground is at most. */
const DARKEST = 0.85;
/** Half widths of the blurs, over the side of the picture: the core of the shadow, and its soft edge. */
const [SHARP, SOFT] = [0.02, 0.075];

export interface ShadowMap {
  /** From 0 to 1, rows from the bottom (the smallest y) to the top. */
  darkness: Float32Array;
  /** Side of the square, its left and bottom ends, and the height of the ground, m. */
  width: number;
  left: number;
  bottom: number;
  ground: number;
}

/** From points (n, 3) in the scene, m, and triangles (k, 3); z is up. */
export function shadowOf(points: Float32Array, triangles: Uint32Array): ShadowMap {
  const { min, max } = new Box3().setFromArray(points);
  const longer = Math.max(max.x - min.x, max.y - min.y, 1e-12);
  const width = (1 + 2 * ROOM) * longer;
  const [left, bottom] = [(min.x + max.x - width) / 2, (min.y + max.y - width) / 2];
  const heights = lowestHeights(points, triangles, left, bottom, width / TEXELS);
  const ground = min.z;
  const core = new Float32Array(heights.length);
  const wide = new Float32Array(heights.length);
  heights.forEach((height, i) => {
    if (height === Infinity) return;
    const near = Math.exp(-(height - ground) / (FADING_HEIGHT * longer));
    core[i] = near;
    wide[i] = 0.5 + 0.5 * near;
  });
  blur(core, Math.round(SHARP * TEXELS));
  blur(wide, Math.round(SOFT * TEXELS));
  const darkness = core.map((part, i) => DARKEST * Math.min(1, 0.5 * part + 0.6 * wide[i]!));
  return { darkness, width, left, bottom, ground };
}

/** Height of the lowest point of the body above each texel; Infinity beside it. */
function lowestHeights(points: Float32Array, triangles: Uint32Array, left: number, bottom: number, step: number): Float32Array {
  const heights = new Float32Array(TEXELS * TEXELS).fill(Infinity);
  for (let t = 0; t < triangles.length; t += 3) {
    const corner = (k: number): Corner => {
      const i = 3 * triangles[t + k]!;
      return [(points[i]! - left) / step - 0.5, (points[i + 1]! - bottom) / step - 0.5, points[i + 2]!];
    };
    lower(heights, corner(0), corner(1), corner(2));
  }
  return heights;
}

/** Column, row, and height. */
type Corner = [number, number, number];

/** Takes the heights of a triangle where they are lower, by barycentric coordinates. */
function lower(heights: Float32Array, a: Corner, b: Corner, c: Corner): void {
  const area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
  if (area === 0) return;
  const [firstX, lastX] = [Math.ceil(Math.min(a[0], b[0], c[0])), Math.floor(Math.max(a[0], b[0], c[0]))];
  const [firstY, lastY] = [Math.ceil(Math.min(a[1], b[1], c[1])), Math.floor(Math.max(a[1], b[1], c[1]))];
  for (let y = Math.max(firstY, 0); y <= Math.min(lastY, TEXELS - 1); y++) {
    for (let x = Math.max(firstX, 0); x <= Math.min(lastX, TEXELS - 1); x++) {
      const u = ((b[0] - x) * (c[1] - y) - (c[0] - x) * (b[1] - y)) / area;
      const v = ((c[0] - x) * (a[1] - y) - (a[0] - x) * (c[1] - y)) / area;
      if (u < 0 || v < 0 || u + v > 1) continue;
      const height = u * a[2] + v * b[2] + (1 - u - v) * c[2];
      const i = TEXELS * y + x;
      if (height < heights[i]!) heights[i] = height;
    }
  }
}

/** Three boxes one after the other are nearly a Gaussian; beyond the edge is nothing. */
function blur(values: Float32Array, half: number): void {
  for (let pass = 0; pass < 3; pass++) {
    for (let line = 0; line < TEXELS; line++) {
      slide(values, line * TEXELS, 1, half);
      slide(values, line, TEXELS, half);
    }
  }
}

/** Mean of neighbours along one line. */
function slide(values: Float32Array, start: number, step: number, half: number): void {
  const line = Float32Array.from({ length: TEXELS }, (_, i) => values[start + i * step]!);
  let sum = 0;
  for (let i = 0; i < half; i++) sum += line[i]!;
  for (let i = 0; i < TEXELS; i++) {
    sum += (line[i + half] ?? 0) - (line[i - half - 1] ?? 0);
    values[start + i * step] = sum / (2 * half + 1);
  }
}
