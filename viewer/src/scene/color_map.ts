// Colour maps, one for each kind of field. The shader and the legend use the same samples.

import * as THREE from "three";

import { colorTexture } from "./region_texture";

/**
 * matplotlib's viridis (CC0), sRGB, in sixteenths, but for its darkest fifth: light falls on what is drawn, and nearly black
 * hides its shape. Straight lines between the samples are within 4/255.
 */
const VIRIDIS = [
  0x414487, 0x3b528b, 0x355f8d, 0x2f6c8e, 0x2a788e, 0x25848e, 0x21918c, 0x1e9c89, 0x22a884, 0x2fb47c, 0x44bf70,
  0x5ec962, 0x7ad151, 0x9bd93c, 0xbddf26, 0xdfe318, 0xfde725,
];

/**
 * For signed fields: the "smooth cool warm" map, made for surfaces in light (Moreland 2009), as matplotlib samples it. Zero
 * is a grey that no tissue has, and lightness falls by the same to both sides, told apart with any colour vision.
 */
const COOL_WARM = [
  0x3b4cc0, 0x445acc, 0x4d68d7, 0x5775e1, 0x6282ea, 0x6c8ef1, 0x779af7, 0x82a5fb, 0x8db0fe, 0x98b9ff, 0xa3c2ff,
  0xaec9fd, 0xb8d0f9, 0xc2d5f4, 0xccd9ee, 0xd5dbe6, 0xdddddd, 0xe5d8d1, 0xecd3c5, 0xf1ccb9, 0xf5c4ad, 0xf7bba0,
  0xf7b194, 0xf7a687, 0xf49a7b, 0xf18d6f, 0xec7f63, 0xe57058, 0xde604d, 0xd55042, 0xcb3e38, 0xc0282f, 0xb40426,
];

/** Width of a texture: one texel for each value of the byte that the server sends. */
const WIDTH = 256;
const LEGEND_STOPS = 33;

export type Rgb = readonly [red: number, green: number, blue: number];

export class ColorMap {
  readonly texture: THREE.DataTexture;

  private constructor(private readonly samples: number[]) {
    const texels = new Uint8Array(4 * WIDTH);
    for (let i = 0; i < WIDTH; i++) texels.set([...this.at(i / (WIDTH - 1)), 255], 4 * i);
    this.texture = colorTexture(texels, WIDTH);
    this.texture.magFilter = this.texture.minFilter = THREE.LinearFilter;
  }

  static readonly sequential = new ColorMap(VIRIDIS);
  static readonly diverging = new ColorMap(COOL_WARM);

  /** Stops of a legend from left to right, as CSS colours. */
  stops(): string[] {
    return Array.from({ length: LEGEND_STOPS }, (_, i) => `rgb(${this.at(i / (LEGEND_STOPS - 1)).join(" ")})`);
  }

  /** The colour at t in 0..1 as three bytes. */
  at(t: number): Rgb {
    const { samples } = this;
    const place = t * (samples.length - 1);
    const low = Math.min(Math.floor(place), samples.length - 2);
    const part = place - low;
    const channel = (shift: number) => {
      const a = (samples[low]! >> shift) & 255;
      const b = (samples[low + 1]! >> shift) & 255;
      return Math.round(a + part * (b - a));
    };
    return [channel(16), channel(8), channel(0)];
  }
}
