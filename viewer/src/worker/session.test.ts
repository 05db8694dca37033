import { describe, expect, it } from "vitest";

import { decodeArrays, decodeBinary, encodeArrays, isScene } from "../net/protocol";
import type { ClientMessage } from "../net/protocol";
import type { Command, Program, Tick } from "./program";
import { readPackage } from "./scene_package";
import type { PageData } from "./scene_package";
import { WorkerSession } from "./session";

const OWN = { shape: "sphere", lengths: [0.006, 0, 0], radius: 0.006, contact_radius: 0.005, friction: 0.3, shapes: [] };
const CAPSULE = {
  description: { shape: { kind: "capsule" } },
  entry: { shape: "capsule" as const, radius: 0.003 },
  table: { shape: "capsule", radius: 0.003 },
};

const data: PageData = {
  version: "0.1.0",
  name: "block",
  about: { rate: "1000.0", scene: JSON.stringify({ tool: [{ shape: "sphere" }] }) },
  settings: {
    type: "settings",
    youngs_modulus: [1e4],
    contact_radius: [0.005],
    friction: [0.3],
    shape: ["sphere"],
    strain_limit: 0.3,
    time_scale: null,
  },
  centre: [0, 0, 0],
  size: 0.1,
  shapes: [{ capsule: CAPSULE }],
  max_radii: [0.01],
  bodies: [{ size: 0.1, nodes_per_face: 3, position: [0, 0, 0], orientation: [1, 0, 0, 0] }],
  motion: null,
};

function pageArrays() {
  return {
    "0/positions": Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0),
    "0/faces": Uint32Array.of(0, 1, 2),
    "0/drawn": Uint32Array.of(0, 1, 2),
    "0/surface_nodes": Uint32Array.of(0, 1, 2),
    "0/inner_nodes": new Uint32Array(),
    "0/inner_rows": new Uint32Array(),
    "0/inner_weights": new Float32Array(),
  };
}

function sceneMessage(): ArrayBuffer {
  const names = ["nodes", "scalar"];
  const body = { name: "block", regions: [], fields: [], server_fields: [], position: [0, 0, 0], orientation: [1, 0, 0, 0] };
  const arrays = {
    "0/nodes": Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0),
    "tools/0/vertices": Float32Array.of(1, 2, 3),
    "tools/0/triangles": Uint32Array.of(0, 0, 0),
  };
  return encodeArrays({ type: "scene", names, bodies: [body], tools: [OWN] }, arrays);
}

/** A scene as `palpate web` packs it. */
function packed(): ArrayBuffer {
  const parts: [string, Uint8Array][] = [
    ["page/scene.bin", new Uint8Array(sceneMessage())],
    ["page/page.bin", new Uint8Array(encodeArrays(data, pageArrays()))],
    ["scene.json", new TextEncoder().encode("{}")],
  ];
  const header = new TextEncoder().encode(JSON.stringify(parts.map(([name, { length }]) => ({ name, size: length }))));
  const padded = (length: number) => (length + 7) & ~7;
  const start = padded(4 + header.length);
  const bytes = new Uint8Array(parts.reduce((at, [, { length }]) => at + padded(length), start));
  new DataView(bytes.buffer).setUint32(0, header.length, true);
  bytes.set(header, 4);
  let at = start;
  for (const [, part] of parts) {
    bytes.set(part, at);
    at += padded(part.length);
  }
  return bytes.buffer;
}

const SUMMARY = { p50: 0, p99: 0, p999: 0, max: 0 };

/** A program that takes commands down and shows a body moved by a millimetre. */
class FakeProgram {
  readonly commands: Command[] = [];
  recorded: Tick["recorded"] = null;
  refusal: string | null = null;

  command(command: Command): void {
    if (this.refusal) throw new Error(this.refusal);
    if (command.do === "record") this.recorded = { ticks: 5, error: null };
    this.commands.push(command);
  }

  advance(): number {
    return 4;
  }

  tick(): Tick {
    const numbers = { time: 0.004, compute_us: SUMMARY, wakeup_us: SUMMARY, ticks: 4, missed_deadlines: 7, fault: null };
    return { ...numbers, tools: [], contacts: [], realtime: false, recorded: this.recorded, body_time: [0] };
  }

  displacements(): Float64Array {
    return Float64Array.of(0, 0, 1e-3, 0, 0, 0, 0, 0, 0);
  }

  log(): Float64Array {
    return new Float64Array(11);
  }

  endRecording(): Uint8Array {
    this.recorded = null;
    return Uint8Array.of(1, 2, 3);
  }
}

function opened() {
  const [program, sent, files] = [new FakeProgram(), [] as (string | ArrayBuffer)[], [] as string[]];
  const replies = { message: (message: string | ArrayBuffer) => sent.push(message), file: (name: string) => files.push(name) };
  const session = new WorkerSession(program as unknown as Program, readPackage(packed()), replies, [{ name: "liver", title: "Liver" }]);
  const texts = () => sent.filter((message) => typeof message === "string").map((text) => JSON.parse(text) as Record<string, unknown>);
  const binaries = () => sent.filter((message) => typeof message !== "string");
  return { program, session, texts, binaries, files };
}

describe("a package", () => {
  it("gives the page its part and the program the rest", () => {
    const { data: read, files, arrays } = readPackage(packed());
    expect(read.name).toBe("block");
    expect([...files.keys()]).toEqual(["scene.json"]);
    expect(Array.from(arrays.get("0/faces")!)).toEqual([0, 1, 2]);
  });

  it("without its page is refused", () => {
    const bytes = new Uint8Array(packed());
    const text = new TextDecoder().decode(bytes).replace("page/page.bin", "page/gone.bin");
    expect(() => readPackage(new TextEncoder().encode(text).buffer)).toThrow();
  });
});

describe("the session of a worker", () => {
  it("begins with welcome, scene and settings, and offers the other scenes", () => {
    const { texts, binaries } = opened();
    expect(texts().map(({ type }) => type)).toEqual(["welcome", "settings"]);
    expect(texts()[0]).toMatchObject({ role: "control", models: [{ name: "liver", title: "Liver" }] });
    expect(binaries()).toHaveLength(1);
  });

  it("sends the next frame when the page has shown the last", () => {
    const { session, binaries } = opened();
    for (const now of [0, 20, 40]) session.wake(now);
    expect(binaries()).toHaveLength(2);
    session.handle({ type: "ack", frame: 1 });
    session.wake(60);
    const frame = decodeBinary(binaries()[2]!);
    if (isScene(frame)) throw new Error("a scene");
    expect(frame.header).toMatchObject({ frame: 2, ticks: 4, missed_deadlines: 7 });
    expect(Array.from(frame.bodies[0]!.displacements).slice(0, 3)).toEqual([0, 0, Math.fround(1e-3)]);
  });

  it("presses, and refuses a place far away", () => {
    const { program, session, texts } = opened();
    session.handle({ type: "press", tool: 0, position: [0, 0, 0.05], grab: false });
    expect(program.commands).toEqual([{ do: "press", tool: 0, position: [0, 0, 0.05], grab: false }]);
    session.handle({ type: "press", tool: 0, position: [0, 0, 5], grab: false });
    expect(texts().at(-1)).toMatchObject({ type: "error", text: "press: the position is far away from the body" });
    expect(program.commands).toHaveLength(1);
  });

  it("refuses a field that it does not compute", () => {
    const { session, texts } = opened();
    session.handle({ type: "field", name: "strain" });
    expect(texts().filter(({ type }) => type === "error")).toEqual([]);
    session.handle({ type: "field", name: "von_mises" });
    expect(texts().at(-1)).toEqual({ type: "error", text: expect.stringContaining("'von_mises' needs Palpate") as string });
  });

  it("answers what the program refuses by its reason", () => {
    const { program, session, texts } = opened();
    program.refusal = "no";
    session.handle({ type: "set", friction: 0.5 });
    expect(texts().at(-1)).toEqual({ type: "error", text: "no" });
  });

  it.each<[ClientMessage, string]>([
    [{ type: "mode", mode: 0 } as unknown as ClientMessage, "To show a mode"],
    [{ type: "setup" } as unknown as ClientMessage, "This"],
    [{ type: "answer", place: 0 } as unknown as ClientMessage, "An exam"],
  ])("names what needs a server: %o", (message, what) => {
    const { session, texts } = opened();
    session.handle(message);
    expect(texts().at(-1)).toEqual({ type: "error", text: `${what} needs Palpate on this computer: pip install palpate` });
  });

  it("gives a tool another shape, with the settings of now, and its own again", () => {
    const { program, session, texts, binaries } = opened();
    session.handle({ type: "set", friction: 0.7 });
    session.handle({ type: "shape", tool: 0, name: "capsule" });
    const commands = program.commands.slice(1);
    expect(commands[0]).toEqual({ do: "tool", tool: 0, description: CAPSULE.description });
    expect(commands).toContainEqual({ do: "set", name: "friction", rank: 0, value: 0.7 });
    expect(texts().at(-1)).toMatchObject({ type: "settings", shape: ["capsule"], friction: [0.7] });
    const { header, arrays } = decodeArrays(binaries().at(-1)!);
    expect((header["tools"] as object[])[0]).toMatchObject({ shape: "capsule", radius: 0.003, friction: 0.3 });
    expect(arrays.get("tools/0/vertices")).toHaveLength(0);
    session.handle({ type: "shape", tool: 0, name: "sphere" });
    expect(program.commands.filter((command) => command.do === "tool").at(-1)).toEqual({ do: "tool", tool: 0, description: undefined });
    expect(decodeArrays(binaries().at(-1)!).arrays.get("tools/0/vertices")).toHaveLength(3);
    session.handle({ type: "shape", tool: 0, name: "spoon" });
    expect(texts().at(-1)).toEqual({ type: "error", text: "shape: this tool is no 'spoon'" });
  });

  it("saves a recording before another tool comes, and records which tool it is", () => {
    const { program, session, files } = opened();
    session.handle({ type: "record", on: true });
    session.handle({ type: "shape", tool: 0, name: "capsule" });
    expect(files).toHaveLength(1);
    session.handle({ type: "record", on: true });
    const last = program.commands.at(-1)!;
    if (last.do !== "record") throw new Error(last.do);
    expect(JSON.parse(last.about["scene"]!)).toEqual({ tool: [CAPSULE.table] });
    session.close();
    expect(files).toHaveLength(2);
  });
});
