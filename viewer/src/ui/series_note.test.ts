import { describe, expect, it } from "vitest";

import { seriesText } from "./series_note";

describe("the line about series beyond small strain", () => {
  it("says how far they are, and nothing when they are there", () => {
    const series = { done: 120, places: 422, left_s: 8, stopped: null };
    expect(seriesText(series)).toBe("Large strain: 120 of 422 places, about 8 s left");
    expect(seriesText({ ...series, left_s: null })).toBe("Large strain: 120 of 422 places");
    expect(seriesText({ ...series, done: 0, places: 0 })).toBe("Large strain: preparing");
    expect(seriesText({ ...series, stopped: "no room on the disk" })).toBe("Large strain: stopped, no room on the disk");
    expect(seriesText(null)).toBe("");
  });
});
