// Colour maps, one for each kind of field. The shader and the legend use the same samples.

import * as THREE from "three";

/** Every sixteenth of matplotlib's viridis (CC0), sRGB; straight lines between them are within 1/255 or so. */
const VIRIDIS = [
  0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c, 0x1fa088, 0x28ae80,
  0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725,
];

/**
 * For signed fields: blue below zero, amber above, told apart with any colour vision; brightness grows with the
 * magnitude, so that it stands out from dark tissue, into which both sides fade at zero.
 */
const DIVERGING = [0xa6e8ff, 0x57b7fb, 0x2f7de0, 0x2a52ae, 0x43395a, 0xa84a1c, 0xe07f1c, 0xfab42f, 0xffeb99];

/** Width of a texture: one texel for each value of the byte that the server sends. */
const WIDTH = 256;
const LEGEND_STOPS = 33;

/** Below this share of the maximum the field fades into the tissue: what is not affected keeps its own colour. */
const FADE_END = 0.16;

export class ColorMap {
  readonly texture: THREE.DataTexture;

  private constructor(private readonly samples: number[], private readonly zero: number) {
    const texels = new Uint8Array(4 * WIDTH);
    for (let i = 0; i < WIDTH; i++) texels.set(this.sample(i / (WIDTH - 1)), 4 * i);
    this.texture = new THREE.DataTexture(texels, WIDTH, 1);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.texture.magFilter = THREE.LinearFilter;
    this.texture.minFilter = THREE.LinearFilter;
    this.texture.needsUpdate = true;
  }

  static readonly sequential = new ColorMap(VIRIDIS, 0);
  static readonly diverging = new ColorMap(DIVERGING, 0.5);

  /** The same map over the tissue's colour, for the legend, from left to right. */
  css(tissue: string): string {
    const stops = Array.from({ length: LEGEND_STOPS }, (_, i) => {
      const [red, green, blue, alpha] = this.sample(i / (LEGEND_STOPS - 1));
      return `rgb(${red} ${green} ${blue} / ${(alpha / 255).toFixed(3)})`;
    });
    return `linear-gradient(to right, ${stops.join(", ")}), ${tissue}`;
  }

  /** The colour at t in 0..1 as four bytes, the last one how far it covers the tissue. */
  private sample(t: number): [number, number, number, number] {
    const { samples, zero } = this;
    const place = t * (samples.length - 1);
    const low = Math.min(Math.floor(place), samples.length - 2);
    const part = place - low;
    const channel = (shift: number) => {
      const a = (samples[low]! >> shift) & 255;
      const b = (samples[low + 1]! >> shift) & 255;
      return Math.round(a + part * (b - a));
    };
    const magnitude = Math.abs(t - zero) / (1 - zero);
    return [channel(16), channel(8), channel(0), Math.round(255 * Math.min(1, magnitude / FADE_END))];
  }
}
