import { describe, expect, it } from "vitest";

import type { ReplayEvent, ReplayScene } from "./net/session_messages";
import { Handle, LONG_SEEK_MS, Way, clock, marksOf, placeOf, stepped, verdict } from "./replay";

const scene = (events: ReplayEvent[] = [], ticks = 20_001): ReplayScene => ({
  name: "liver.mcap",
  path: "/liver.mcap",
  ticks,
  rate: 1000,
  events,
  note: null,
});

describe("times", () => {
  it.each([
    [1, "0.001"],
    [999, "0.999"],
    [59_999, "59.999"],
    [60_000, "1:00.000"],
    [605_050, "10:05.050"],
  ])("of tick %i at 1 kHz is %s", (tick, text) => {
    expect(clock(tick, 1000)).toBe(text);
  });

  it("are rounded to the millisecond, also up to a minute", () => {
    expect(clock(479_997, 8000)).toBe("1:00.000");
    expect(clock(1, 8000)).toBe("0.000");
  });
});

describe("places on the line", () => {
  it("go from the first tick to the last", () => {
    expect(placeOf(1, 5)).toBe(0);
    expect(placeOf(3, 5)).toBe(0.5);
    expect(placeOf(5, 5)).toBe(1);
  });

  it("stay on it, also where there is one tick only", () => {
    expect(placeOf(9, 5)).toBe(1);
    expect(placeOf(1, 1)).toBe(0);
    expect(stepped(1, -1, 5)).toBe(1);
    expect(stepped(3, 1, 5)).toBe(4);
    expect(stepped(5, 1, 5)).toBe(5);
  });
});

describe("marks", () => {
  it("stand where their ticks are, with time and words", () => {
    const marks = marksOf(scene([{ tick: 10_001, kind: "strike", text: "strike of 1 N s on body 0" }]));
    expect(marks).toEqual([{ place: 0.5, tick: 10_001, kind: "strike", text: "10.001 s: strike of 1 N s on body 0" }]);
  });

  it("that would cover each other are one, of the gravest kind", () => {
    const marks = marksOf(
      scene([
        { tick: 1, kind: "reset", text: "reset" },
        { tick: 50, kind: "fault", text: "tool 0: stale" },
        { tick: 90, kind: "strike", text: "strike" },
        { tick: 9000, kind: "reset", text: "reset" },
      ]),
    );
    expect(marks.map(({ tick, kind }) => [tick, kind])).toEqual([
      [1, "fault"],
      [9000, "reset"],
    ]);
    expect(marks[0]!.text.split("\n")).toHaveLength(3);
  });
});

describe("the verdict", () => {
  it("is about the ticks that were compared", () => {
    expect(verdict({ difference: null, checked: 1500 }, scene())).toBe("Bit-identical so far, to 1.500 s");
    expect(verdict({ difference: null, checked: 20_001 }, scene())).toBe("All 20,001 ticks are bit-identical");
  });

  it("names tick, tool and quantity of the first difference", () => {
    const difference = { tick: 1250, of: "tool 1", quantity: "computed force", text: "" };
    expect(verdict({ difference, checked: 20_001 }, scene())).toBe(
      "Not as recorded from tick 1250 (1.250 s) on: tool 1, computed force",
    );
    expect(verdict({ difference: { ...difference, of: "" }, checked: 1250 }, scene())).toContain("on: computed force");
  });
});

describe("the way to a tick", () => {
  it("is reported once it has taken a while, until it is there", () => {
    const way = new Way();
    expect(way.seekProgress({ tick: 10, goal: 10 }, 0)).toBeNull();
    expect(way.seekProgress({ tick: 20, goal: 100 }, 10)).toBeNull();
    expect(way.seekProgress({ tick: 40, goal: 100 }, 10 + LONG_SEEK_MS)).toBe(0.4);
    // The line is dragged on meanwhile.
    expect(way.seekProgress({ tick: 50, goal: 200 }, 20 + LONG_SEEK_MS)).toBe(0.25);
    expect(way.seekProgress({ tick: 200, goal: 200 }, 30 + LONG_SEEK_MS)).toBeNull();
    expect(way.seekProgress({ tick: 200, goal: 300 }, 40 + LONG_SEEK_MS)).toBeNull();
  });
});

describe("the handle", () => {
  it("stays where it was put until the server has the same", () => {
    const handle = new Handle(1000);
    expect(handle.shown(5, 0)).toBe(5);
    handle.move(80, 10);
    expect(handle.shown(6, 20)).toBe(80);
    expect(handle.shown(80, 30)).toBe(80);
    expect(handle.shown(81, 40)).toBe(81);
  });

  it("follows the server again where no answer comes", () => {
    const handle = new Handle(1000);
    handle.move(80, 0);
    expect(handle.shown(6, 1000)).toBe(80);
    expect(handle.shown(7, 1001)).toBe(7);
  });
});
