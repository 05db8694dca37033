import { describe, expect, it } from "vitest";

import { sizeText } from "./numbers";

describe("the size of a body", () => {
  it("is told in the unit that suits its longest side", () => {
    expect(sizeText([0.08, 0.05, 0.05])).toBe("80 × 50 × 50 mm");
    expect(sizeText([0.20004, 0.12345, 0.0801])).toBe("200 × 123.5 × 80.1 mm");
    expect(sizeText([64, 40.04, 28])).toBe("64 × 40.04 × 28 m");
    expect(sizeText([0.00008, 0.00005, 0.00005])).toBe("80 × 50 × 50 µm");
  });
});
