// Viridis: perceptually uniform, and readable with any colour vision. The shader and the legend use the same samples.

import * as THREE from "three";

/** Every sixteenth of matplotlib's viridis (CC0), sRGB; straight lines between them are within 1/255 or so. */
const SAMPLES = [
  0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c, 0x1fa088, 0x28ae80,
  0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725,
];

/** Width of the texture: one texel for each value of the byte that the server sends. */
const WIDTH = 256;
const LEGEND_STOPS = 33;

/** Below this share of the maximum the field fades into the tissue: what does not move keeps its own colour. */
const FADE_END = 0.16;

/** The colour at t in 0..1 as four bytes, the last one how far it covers the tissue. */
function sample(t: number): [number, number, number, number] {
  const place = t * (SAMPLES.length - 1);
  const low = Math.min(Math.floor(place), SAMPLES.length - 2);
  const part = place - low;
  const channel = (shift: number) => {
    const a = (SAMPLES[low]! >> shift) & 255;
    const b = (SAMPLES[low + 1]! >> shift) & 255;
    return Math.round(a + part * (b - a));
  };
  return [channel(16), channel(8), channel(0), Math.round(255 * Math.min(1, t / FADE_END))];
}

export function createColorMapTexture(): THREE.DataTexture {
  const texels = new Uint8Array(4 * WIDTH);
  for (let i = 0; i < WIDTH; i++) texels.set(sample(i / (WIDTH - 1)), 4 * i);
  const texture = new THREE.DataTexture(texels, WIDTH, 1);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.magFilter = THREE.LinearFilter;
  texture.minFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The same map over the tissue's colour, for the legend, from left to right. */
export function colorMapCss(tissue: string): string {
  const stops = Array.from({ length: LEGEND_STOPS }, (_, i) => {
    const [red, green, blue, alpha] = sample(i / (LEGEND_STOPS - 1));
    return `rgb(${red} ${green} ${blue} / ${(alpha / 255).toFixed(3)})`;
  });
  return `linear-gradient(to right, ${stops.join(", ")}), ${tissue}`;
}
