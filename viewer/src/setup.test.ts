import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";

import { maskOfNodes, nodesOfMask } from "./net/computed_messages";
import type { ClientMessage, SceneMessage } from "./net/protocol";
import type { SetupBody, SetupMessage } from "./net/setup_messages";
import { Painting } from "./painting";
import { Setup, hindrance } from "./setup";
import { Store } from "./store";
import { refusal } from "./upload";

const COUNT = 20_000;
const TISSUES = [
  { name: "soft", title: "Soft", youngs_modulus: 5e3, spread: 0, poissons_ratio: 0.49, source: "a" },
  { name: "hard", title: "Hard", youngs_modulus: 9e4, spread: 1e3, poissons_ratio: 0.4, source: "b" },
];
const BODY: SetupBody = {
  name: "organ", file: "organ.stl", unit: "mm", units: [], fitting: ["mm"], size: [0.1, 0.08, 0.06], low: [-0.05, 0, 0],
  filled: true, nodes: 9, tets: 4, notes: [], painted: true, held: null, plane: { axis: 2, above: false, depth: 0.01 },
  tissue: "soft", youngs_modulus: 5e3, poissons_ratio: 0.49, radius: 0.006, nodule: null, segments: [], saved: "/a/organ.toml",
};
const MESSAGE: SetupMessage = { type: "setup", limit: 1000, part: 400, endings: [".stl", ".ply"], tissues: TISSUES, editing: true, preparing: false, body: BODY };

function settingUp(body: Partial<SetupBody> = {}) {
  const store = new Store();
  const [sent, parts, notices]: [ClientMessage[], number[], string[]] = [[], [], []];
  const send = (message: ClientMessage) => sent.push(message);
  const setup = new Setup(store, send, (bytes) => parts.push(bytes.byteLength), (text) => notices.push(text));
  const painting = new Painting(store, send);
  const scene = { name: "set up organ", bodies: [{ surface_nodes: COUNT }], tools: [] } as unknown as SceneMessage;
  store.update({ role: "control", connection: "open", scene });
  setup.receive({ ...MESSAGE, body: { ...BODY, ...body } });
  return { store, sent, parts, notices, setup, painting };
}

describe("setting up", () => {
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("window", globalThis);
  });
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  it("sends what is painted as all supports there are, and takes it back", () => {
    const { store, sent, painting } = settingUp();
    painting.add([Uint32Array.of(5, 17_000)]);
    painting.add([Uint32Array.of(6)]);
    painting.undo();
    const last = sent.slice(-2) as { first: number; nodes: string }[];
    const nodes = last.flatMap(({ first, nodes }) => Array.from(nodesOfMask(nodes), (node) => first + node));
    expect(nodes).toEqual([5, 17_000]);
    expect(store.get().setup!.body).toMatchObject({ held: maskOfNodes([5, 17_000], COUNT), saved: null });
  });

  it("shows what the server has of the supports, in a page that is opened anew too", () => {
    const { store } = settingUp({ held: maskOfNodes([3, 4], COUNT) });
    expect(store.get().strokes.map(([nodes]) => Array.from(nodes!))).toEqual([[3, 4]]);
  });

  it("gives a segment a material of its own", () => {
    const { store, sent, setup } = settingUp({ segments: [{ name: "tumor", tissue: "soft" }, { name: "cyst", tissue: "soft" }] });
    setup.chooseSegment("cyst", "hard");
    const segments = [{ name: "tumor", tissue: "soft" }, { name: "cyst", tissue: "hard" }];
    expect(store.get().setup!.body).toMatchObject({ segments, saved: null });
    expect(sent).toContainEqual({ type: "setup", segments });
  });

  it("sends choices together, the newest of each, and before the touch", () => {
    const { store, sent, setup } = settingUp();
    setup.choose({ tissue: "hard" });
    setup.choose({ radius: 0.004 });
    setup.choose({ radius: 0.005 });
    expect(store.get().setup!.body).toMatchObject({ tissue: "hard", youngs_modulus: 9e4, poissons_ratio: 0.4, radius: 0.005 });
    setup.touch();
    expect(sent).toEqual([{ type: "setup", tissue: "hard" }, { type: "setup", radius: 0.005 }, { type: "touch" }]);
    vi.advanceTimersByTime(1000);
    expect(sent.length).toBe(3);
  });

  it("keeps the middle of a nodule in the box of the body", () => {
    const { store, setup } = settingUp();
    setup.toggleNodule();
    expect(store.get().setup!.body!.nodule).toMatchObject({ center: [0, 0.04, 0.03], youngs_modulus: 25e3 });
    setup.moveNodule({ center: [9, -9, 0.02] });
    expect(store.get().setup!.body!.nodule!.center).toEqual([0.05, 0, 0.02]);
  });

  it("names what is missing before a touch", () => {
    const { store, setup } = settingUp();
    expect(hindrance(store.get())).toMatch(/Paint/);
    setup.choose({ painted: false });
    expect(hindrance(store.get())).toBeNull();
    expect(hindrance(settingUp({ unit: null }).store.get())).toMatch(/unit/);
    expect(hindrance(settingUp({ filled: false }).store.get())).toMatch(/filled/);
  });

  it("sends a file in parts, each after the answer to the one before, and stops at an error", async () => {
    const { parts, sent, setup, store } = settingUp();
    setup.open([new File([new Uint8Array(900)], "organ.stl")]);
    expect(sent).toEqual([{ type: "upload", name: "organ.stl", size: 900 }]);
    for (const bytes of [0, 400, 800]) {
      setup.receive({ type: "uploaded", bytes });
      await vi.waitFor(() => expect(parts.length).toBe(bytes / 400 + 1));
    }
    expect(parts).toEqual([400, 400, 100]);
    store.update({ status: null });
    setup.open([new File([new Uint8Array(900)], "other.stl")]);
    setup.receive({ type: "error", text: "no" });
    setup.receive({ type: "uploaded", bytes: 0 });
    await vi.advanceTimersByTimeAsync(50);
    expect(parts.length).toBe(3);
    expect(store.get().status).toBeNull();
  });

  it("refuses files that the server would", () => {
    expect(refusal({ name: "a.PLY", size: 1000 }, MESSAGE)).toBeNull();
    expect(refusal({ name: "a.ply", size: 1001 }, MESSAGE)).toMatch(/MB/);
    expect(refusal({ name: "a.ply", size: 0 }, MESSAGE)).toMatch(/empty/);
    expect(refusal({ name: "a.toml", size: 10 }, MESSAGE)).toMatch(/palpate run/);
    expect(refusal({ name: "stl", size: 10 }, MESSAGE)).toMatch(/\.stl/);
  });
});
