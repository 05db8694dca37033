import { beforeEach, describe, expect, it } from "vitest";

import { Control } from "./control";
import type { ClientMessage, FrameMessage, SceneMessage } from "./net/protocol";
import { Store } from "./store";

const body = { youngs_modulus: 1e4, tets: 1, fields: [{ name: "displacement", title: "Displacement" }] };
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
    store.update({ connection: "open", role: "control" });
    control.takeScene(scene(2));
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
    control.takeScene(scene(1));
    pressWith(0);
    control.togglePin();
    expect(store.get().pressing).not.toBeNull();
    expect(store.get().pinned).toEqual([]);
  });

  it("are pinned no more once they have left the scene", () => {
    pressWith(0);
    control.togglePin();
    // Frames from before the press arrived do not count.
    control.takeFrame(frame(false, false));
    expect(store.get().pinned).toEqual([0]);
    control.takeFrame(frame(true, false));
    control.takeFrame(frame(false, false));
    expect(store.get().pinned).toEqual([]);
  });

  it("are let go when control is lost, and with a new scene", () => {
    for (const end of [() => control.takeText({ type: "role", role: "watch" }), () => control.takeScene(scene(2))]) {
      store.update({ role: "control" });
      pressWith(0);
      control.togglePin();
      end();
      expect(store.get().pinned).toEqual([]);
    }
  });
});
