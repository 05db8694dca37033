import { describe, expect, it } from "vitest";

import { maskOfNodes, nodesOfMask } from "./net/computed_messages";
import type { ClientMessage, SceneMessage } from "./net/protocol";
import { NOT_READY, NOT_TOUCHABLE, PAINTED, Painting, READY, WAITING, countStates, isGrowing, touchStates } from "./painting";
import { Store } from "./store";

const COUNT = 20_000;

function growing() {
  const store = new Store();
  const sent: ClientMessage[] = [];
  const painting = new Painting(store, (message) => sent.push(message));
  const ready = maskOfNodes([0, 1, 2, 17_000], COUNT);
  store.update({
    role: "control",
    connection: "open",
    scene: { bodies: [{ surface_nodes: COUNT }, { surface_nodes: 8 }] } as unknown as SceneMessage,
    computed: {
      type: "computed",
      bodies: [
        { ready, done: 12, columns: 60_000, left_s: 30, region: null, waiting: null, stopped: null },
        { ready: null, done: 24, columns: 24, left_s: 0, region: null, waiting: null, stopped: null },
      ],
      series: null,
    },
  });
  return { store, sent, painting };
}

describe("painting", () => {
  it("marks what is neither ready nor asked for, and takes it back", () => {
    const { store, painting } = growing();
    painting.add([Uint32Array.of(1, 5, 6), Uint32Array.of(3)]);
    painting.add([Uint32Array.of(6, 7), new Uint32Array(0)]);
    const states = touchStates(store.get(), 0)!;
    expect([states[1], states[5], states[7], states[8]]).toEqual([READY, PAINTED, PAINTED, NOT_READY]);
    expect(touchStates(store.get(), 1)).toBeNull();
    expect(countStates(store.get())).toEqual([4 + 8, 0, COUNT - 4 - 3, 0, 3]);
    painting.undo();
    expect(touchStates(store.get(), 0)![7]).toBe(NOT_READY);
    painting.clear();
    expect(store.get().strokes).toEqual([]);
    // A stroke over what is ready is none.
    painting.add([Uint32Array.of(0, 2), new Uint32Array(0)]);
    expect(store.get().strokes).toEqual([]);
  });

  it("asks for all strokes in messages of bounded length", () => {
    const { store, sent, painting } = growing();
    painting.choose("brush");
    painting.add([Uint32Array.of(5, 16_383), new Uint32Array(0)]);
    painting.add([Uint32Array.of(5, 16_384, 19_999), new Uint32Array(0)]);
    painting.compute();
    expect(sent.map((message) => message.type)).toEqual(["paint", "paint"]);
    const asked = sent.flatMap((message) => {
      if (message.type !== "paint") return [];
      expect(message.first % 8).toBe(0);
      expect(JSON.stringify(message).length).toBeLessThan(4096);
      return Array.from(nodesOfMask(message.nodes), (node) => message.first + node);
    });
    expect(asked).toEqual([5, 16_383, 16_384, 19_999]);
    const state = store.get();
    expect([state.strokes.length, state.paintTool]).toEqual([0, null]);
  });

  it("shows what the server has been asked for, and what it never computes", () => {
    const { store, painting } = growing();
    const [body, other] = store.get().computed!.bodies;
    const masks = { region: maskOfNodes([0, 5, 6, 7], COUNT), waiting: maskOfNodes([5, 6], COUNT), ready: maskOfNodes([5], COUNT) };
    store.update({ computed: { type: "computed", bodies: [{ ...body!, ...masks }, other!], series: null } });
    painting.add([Uint32Array.of(0, 6, 8), new Uint32Array(0)]);
    const states = touchStates(store.get(), 0)!;
    expect([0, 5, 6, 7, 8].map((node) => states[node])).toEqual([PAINTED, READY, WAITING, NOT_READY, NOT_TOUCHABLE]);
    expect(countStates(store.get())).toEqual([1 + 8, COUNT - 4, 1, 1, 1]);
  });

  it("is put away where it can do nothing", () => {
    const { store, sent, painting } = growing();
    painting.choose("lasso");
    expect(store.get().paintTool).toBe("lasso");
    store.update({ role: "watch" });
    expect(store.get().paintTool).toBeNull();
    painting.choose("brush");
    painting.add([Uint32Array.of(9), new Uint32Array(0)]);
    painting.compute();
    expect([store.get().paintTool, sent.length]).toEqual([null, 0]);
    store.update({ role: "control", computed: null });
    expect(isGrowing(store.get())).toBe(false);
    painting.choose("brush");
    expect(store.get().paintTool).toBeNull();
  });
});
