import { describe, expect, it } from "vitest";

import { parseQuantity, sizeText } from "./numbers";

describe("the size of a body", () => {
  it("is told in the unit that suits its longest side", () => {
    expect(sizeText([0.08, 0.05, 0.05])).toBe("80 × 50 × 50 mm");
    expect(sizeText([0.20004, 0.12345, 0.0801])).toBe("200 × 123.5 × 80.1 mm");
    expect(sizeText([64, 40.04, 28])).toBe("64 × 40.04 × 28 m");
    expect(sizeText([0.00008, 0.00005, 0.00005])).toBe("80 × 50 × 50 µm");
  });
});

describe("a number that was typed", () => {
  const units = { Pa: 1, kPa: 1e3, MPa: 1e6 };

  it.each<[string, number]>([
    ["12", 12e3],
    [" 12.5 kPa ", 12.5e3],
    ["12,5kpa", 12.5e3],
    ["1e4 Pa", 1e4],
    [".5 MPa", 5e5],
    ["\u22123 Pa", -3],
    ["-3Pa", -3],
  ])("%s is read, with its unit or with the usual one", (text, value) => {
    expect(parseQuantity(text, units, "kPa")).toBeCloseTo(value, 9);
  });

  it.each(["", "soft", "kPa", "12 mm", "1 2", "1.2.3", "e5", "NaN", "Infinity", "1e999"])("%s is refused", (text) => {
    expect(parseQuantity(text, units, "kPa")).toBeNull();
  });

  it("needs no unit where there is none", () => {
    expect(parseQuantity("0.3", {}, "")).toBe(0.3);
    expect(parseQuantity("0.3 mm", {}, "")).toBeNull();
  });
});
