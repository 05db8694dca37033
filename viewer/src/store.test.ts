import { describe, expect, it } from "vitest";

import { Store, drivenTool, shownTool } from "./store";
import type { SceneMessage } from "./net/protocol";

const tool = { device: null, radius: 0.005, contact_radius: 0.005, max_contact_radius: 0.01, friction: 0.3, shape: "sphere" };

describe("the store", () => {
  it("tells a listener at once, and of every change of its keys", () => {
    const store = new Store();
    const heard: [boolean, boolean][] = [];
    store.subscribe(["grab", "strike"], ({ grab, strike }) => heard.push([grab, strike]));
    store.update({ grab: true });
    store.update({ body: 1 });
    store.update({ grab: true });
    store.update({ grab: false, strike: true });
    expect(heard).toEqual([
      [false, false],
      [true, false],
      [false, true],
    ]);
  });

  it("gives listeners the state as it is when they are called", () => {
    const store = new Store();
    const heard: number[] = [];
    store.subscribe(["grab"], ({ grab }) => {
      if (grab) store.update({ body: 7 });
    });
    store.subscribe(["grab"], ({ body }) => heard.push(body));
    store.update({ grab: true });
    expect(heard).toEqual([0, 7]);
  });

  it("keeps what was read before", () => {
    const store = new Store();
    const before = store.get();
    store.update({ grab: true });
    expect([before.grab, store.get().grab]).toEqual([false, true]);
  });

  it("drives the first tool that is not pinned", () => {
    const store = new Store();
    expect(drivenTool(store.get())).toBeNull();
    store.update({ scene: { tools: [tool, tool] } as unknown as SceneMessage });
    expect(drivenTool(store.get())).toBe(0);
    store.update({ pinned: [0] });
    expect(drivenTool(store.get())).toBe(1);
    store.update({ pinned: [0, 1] });
    expect(drivenTool(store.get())).toBeNull();
    store.update({ pinned: [0, 1], pressing: { tool: 1, grab: false, depth: 0 } });
    expect(drivenTool(store.get())).toBe(1);
  });

  it("leaves a tool to its device, and shows that one's numbers", () => {
    const store = new Store();
    const moved = { ...tool, device: "Haply Inverse3 0A01" };
    store.update({ scene: { tools: [tool, moved] } as unknown as SceneMessage });
    expect([drivenTool(store.get()), shownTool(store.get())]).toEqual([0, 1]);
    store.update({ pressing: { tool: 0, grab: false, depth: 0 } });
    expect([drivenTool(store.get()), shownTool(store.get())]).toEqual([0, 0]);
    store.update({ pressing: null, scene: { tools: [moved] } as unknown as SceneMessage });
    expect([drivenTool(store.get()), shownTool(store.get())]).toEqual([null, 0]);
  });
});
