import { expect, it } from "vitest";

import { lengthText } from "./numbers";
import { roundLength } from "./scale_view";

it.each([
  [0.11, 0.1, "100 mm"],
  [0.0999, 0.05, "50 mm"],
  [0.05, 0.05, "50 mm"],
  [0.0449, 0.02, "20 mm"],
  [0.00017, 0.0001, "100 µm"],
  [0.001, 0.001, "1 mm"],
  [7.3, 5, "5 m"],
])("a bar of at most %d m is %d m long: %s", (longest, length, text) => {
  expect(roundLength(longest)).toBeCloseTo(length, 12);
  expect(lengthText(roundLength(longest))).toBe(text);
});
