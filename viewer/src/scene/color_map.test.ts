import { describe, expect, it } from "vitest";

import { ColorMap } from "./color_map";
import type { Rgb } from "./color_map";

/** CIE lightness L* of an sRGB colour, 0 to 100 (CIE 15, with the white D65). */
function lightness(color: Rgb): number {
  const [red, green, blue] = color.map((byte) => {
    const c = byte / 255;
    return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  }) as [number, number, number];
  const luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  return luminance > 216 / 24389 ? 116 * Math.cbrt(luminance) - 16 : (24389 / 27) * luminance;
}

const SHARES = Array.from({ length: 101 }, (_, i) => i / 100);

describe("the map from zero on", () => {
  it("grows lighter in proportion to the value", () => {
    const [first, last] = [lightness(ColorMap.sequential.at(0)), lightness(ColorMap.sequential.at(1))];
    expect(last - first).toBeGreaterThan(55);
    for (const t of SHARES) {
      expect(Math.abs(lightness(ColorMap.sequential.at(t)) - (first + t * (last - first)))).toBeLessThan(2);
    }
  });
});

describe("the map of signed fields", () => {
  it("is lightest at zero, and as dark at both ends", () => {
    const zero = lightness(ColorMap.diverging.at(0.5));
    for (const t of SHARES.filter((share) => share > 0)) {
      const [below, above] = [0.5 - t / 2, 0.5 + t / 2].map((place) => lightness(ColorMap.diverging.at(place)));
      expect(Math.abs(below! - above!)).toBeLessThan(4);
      expect(Math.max(below!, above!)).toBeLessThan(zero);
    }
    // Grey: its channels are equal.
    const [red, green, blue] = ColorMap.diverging.at(0.5);
    expect(Math.max(red, green, blue) - Math.min(red, green, blue)).toBeLessThan(3);
  });
});

it("what a legend shows are the colours of the map", () => {
  const stops = ColorMap.sequential.stops();
  expect(stops[0]).toBe(`rgb(65 68 135)`);
  expect(stops.at(-1)).toBe("rgb(253 231 37)");
});
