import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";

import { Control, NO_INSIDE } from "./control";
import type { ClientMessage, FrameMessage, SceneMessage } from "./net/protocol";
import { Store } from "./store";

const region = (youngs_modulus: number) => ({ title: "Part", youngs_modulus, poissons_ratio: 0.45, density: 1000 });
const body = {
  youngs_modulus: 1e4,
  tets: 1,
  fields: ["displacement", "strain"].map((name) => ({ name, title: name })),
  regions: [region(1e4), region(2e4)],
};
const tool = { radius: 0.005, contact_radius: 0.005, max_contact_radius: 0.01, friction: 0.3, shape: "sphere" };

function scene(tools: number): SceneMessage {
  return { bodies: [body], tools: new Array(tools).fill(tool), motion: null } as unknown as SceneMessage;
}

function frame(...active: boolean[]): FrameMessage {
  return { tools: active.map((one) => ({ active: one })) } as unknown as FrameMessage;
}

describe("tools that are pinned", () => {
  let store: Store;
  let sent: ClientMessage[];
  let control: Control;

  beforeEach(() => {
    store = new Store();
    sent = [];
    control = new Control(store, (message) => sent.push(message));
    store.update({ connection: "open", role: "control", coloring: "field" });
    control.receiveScene(scene(2));
  });

  const pressWith = (index: number) => store.update({ pressing: { tool: index, grab: false, depth: 0 } });

  it("stay without a message, and go with one for all", () => {
    pressWith(0);
    control.togglePin();
    expect(store.get()).toMatchObject({ pressing: null, pinned: [0] });
    expect(sent).toEqual([]);
    pressWith(1);
    control.letGo(true);
    expect(sent).toEqual([{ type: "release", tool: 1 }]);
    control.togglePin();
    expect(store.get().pinned).toEqual([]);
    expect(sent.at(-1)).toEqual({ type: "release" });
  });

  it("may be asked for before the press, and only a pointer that was let go leaves one", () => {
    control.togglePin();
    pressWith(0);
    control.letGo(false);
    expect(store.get().pinned).toEqual([]);
    expect(sent).toEqual([{ type: "release", tool: 0 }]);
    pressWith(0);
    control.letGo(true);
    expect(store.get()).toMatchObject({ pinned: [0], pinNext: false });
  });

  it("are not offered for a single tool", () => {
    control.receiveScene(scene(1));
    pressWith(0);
    control.togglePin();
    expect(store.get().pressing).not.toBeNull();
    expect(store.get().pinned).toEqual([]);
  });

  it("are pinned no more once they have left the scene", () => {
    pressWith(0);
    control.togglePin();
    // Frames from before the press arrived do not count.
    control.receiveFrame(frame(false, false));
    expect(store.get().pinned).toEqual([0]);
    control.receiveFrame(frame(true, false));
    control.receiveFrame(frame(false, false));
    expect(store.get().pinned).toEqual([]);
  });

  it("are let go when control is lost, and with a new scene", () => {
    for (const end of [() => control.receiveText({ type: "role", role: "watch" }), () => control.receiveScene(scene(2))]) {
      store.update({ role: "control" });
      pressWith(0);
      control.togglePin();
      end();
      expect(store.get().pinned).toEqual([]);
    }
  });
});

describe("what is shown", () => {
  let store: Store;
  let sent: ClientMessage[];
  let control: Control;

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("window", globalThis);
    store = new Store();
    sent = [];
    control = new Control(store, (message) => sent.push(message));
    store.update({ connection: "open", role: "control", coloring: "field" });
    control.receiveScene({ ...scene(2), name: "block" });
  });

  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  it("goes from field to field, on to regions and materials, and to tissue", () => {
    const seen = Array.from({ length: 5 }, () => {
      control.nextField();
      const { coloring, field } = store.get();
      return coloring === "field" ? field : coloring;
    });
    expect(seen).toEqual(["strain", "region", "material", "strained", "displacement"]);
  });

  it("begins with tissue that shows strain, and keeps to it on another body", () => {
    store.update({ coloring: "strained" });
    control.receiveScene({ ...scene(1), name: "another" });
    expect(store.get().coloring).toBe("strained");
    expect(sent.at(-1)).toEqual({ type: "field", name: "strain" });
    // A map that was measured is what the scene was opened for.
    const measured = scene(1);
    measured.bodies[0]!.fields.unshift({ name: "palpated_stiffness", title: "Palpated stiffness" });
    control.receiveScene({ ...measured, name: "measured" });
    expect(store.get().coloring).toBe("field");
  });

  it("shows plots with all controls", () => {
    control.togglePlots();
    expect(store.get()).toMatchObject({ more: true, layers: { plots: true } });
    control.togglePlots();
    expect(store.get()).toMatchObject({ more: true, layers: { plots: false } });
  });

  it("ends where it was locked, each field by itself, until the lock or the scene goes", () => {
    control.lockRange("strain", 5);
    control.chooseField("displacement");
    control.chooseField("strain");
    expect(sent).toEqual([
      { type: "field", name: "strain", max: 5 },
      { type: "field", name: "displacement" },
      { type: "field", name: "strain", max: 5 },
    ]);
    control.sendView();
    expect(sent.at(-1)).toEqual({ type: "field", name: "strain", max: 5 });
    control.receiveScene({ ...scene(1), name: "block" });
    expect(store.get().ranges).toEqual({ strain: 5 });
    control.receiveScene({ ...scene(1), name: "another" });
    expect(store.get().ranges).toEqual({});
    expect(sent.at(-1)).toEqual({ type: "field", name: "strain" });
  });

  it("sends no value of the scene before to the next one", () => {
    control.setFriction(0.5);
    control.setFriction(0.9);
    control.receiveScene({ ...scene(2), name: "another" });
    vi.runAllTimers();
    expect(sent).toEqual([{ type: "set", friction: 0.5, tool: 0 }]);
  });

  it("shows no work that ended while it was away", () => {
    control.receiveText({ type: "status", text: "Solving", progress: 0.5, left_s: null });
    control.receiveText({ type: "welcome", role: "control", version: "1", models: [] });
    expect(store.get().status).toBeNull();
  });

  it("is reset with all that was on its way", () => {
    control.setFriction(0.5);
    control.setFriction(0.9);
    control.hold({ tilt: 30 });
    control.showScaled(4);
    control.reset();
    vi.runAllTimers();
    expect(sent).toEqual([{ type: "set", friction: 0.5, tool: 0 }, { type: "reset" }]);
    expect(store.get()).toMatchObject({ shownScale: 1, postures: [{ tilt: 0, turn: 0 }, { tilt: 0, turn: 0 }] });
    // The answer counts, however short a time after the slider was moved it comes.
    const { settings } = store.get();
    control.receiveText({ ...settings!, friction: [0.3, 0.3] });
    expect(store.get().settings?.friction).toEqual([0.3, 0.3]);
  });

  it("says why a store is not cut open", () => {
    control.receiveScene({ ...scene(1), bodies: [{ ...body, tets: 0, regions: [] }] } as unknown as SceneMessage);
    control.toggleLayer("cutaway");
    expect(store.get().layers.cutaway).toBe(false);
    expect(store.get().notices).toEqual([NO_INSIDE]);
    expect(sent).toEqual([]);
  });
});

describe("an exam", () => {
  const exam = { type: "exam", trial: 1, trials: 2, places: [], result: null } as const;
  let store: Store;
  let sent: ClientMessage[];
  let control: Control;

  beforeEach(() => {
    store = new Store();
    sent = [];
    control = new Control(store, (message) => sent.push(message));
    store.update({ connection: "open", role: "control", coloring: "field" });
    control.receiveText({ ...exam, places: [] });
    control.receiveScene(scene(1));
  });

  it("shows nothing that an eye could read it from, whatever key is hit", () => {
    for (const layer of ["colors", "wireframe", "supports", "cutaway", "plots"] as const) control.toggleLayer(layer);
    expect(Object.values(store.get().layers)).toEqual([false, false, false, false, false]);
    expect(sent).toEqual([]);
  });

  it("takes one answer a trial, and the next one with the next scene", () => {
    control.answer(true);
    control.answer(false);
    expect(sent).toEqual([{ type: "answer", found: true }]);
    control.receiveText({ ...exam, trial: 2, places: [] });
    expect(store.get().answering).toBe(true);
    control.receiveScene(scene(1));
    control.answer(false);
    expect(sent.at(-1)).toEqual({ type: "answer", found: false });
  });

  it("takes the answer again where the server refused it, and none when it is over", () => {
    control.answer(true);
    control.receiveText({ type: "error", text: "touch the body first" });
    control.answer(true);
    expect(sent).toHaveLength(2);
    control.receiveText({ ...exam, places: [], result: { lines: [], plot: "" } });
    control.answer(true);
    expect(sent).toHaveLength(2);
    expect(store.get().answering).toBe(false);
  });
});

describe("the scene's own strike", () => {
  const strike = { point: [0, 0, 0], impulse: [0, 0, 1] };
  let sent: ClientMessage[];
  let control: Control;

  beforeEach(() => {
    vi.useFakeTimers();
    const store = new Store();
    sent = [];
    control = new Control(store, (message) => sent.push(message));
    store.update({ connection: "open", role: "control", coloring: "field" });
    control.receiveScene({ ...scene(1), name: "beam", motion: { strike } } as unknown as SceneMessage);
  });

  afterEach(() => {
    vi.useRealTimers();
  });

  it("is given once a body that nobody touches has been seen at rest", () => {
    vi.advanceTimersByTime(500);
    expect(sent).toEqual([]);
    vi.advanceTimersByTime(5000);
    expect(sent).toEqual([{ type: "repeat" }]);
  });

  it("does not end a mode that was chosen before", () => {
    control.showMode(3);
    vi.advanceTimersByTime(5000);
    expect(sent).toEqual([{ type: "mode", number: 3 }]);
  });
});
