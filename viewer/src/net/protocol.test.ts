import { expect, it, describe } from "vitest";

import goldenFrame from "../../../tests/data/golden_frame.bin?inline";
import frameContent from "../../../tests/data/golden_frame.json";
import goldenScene from "../../../tests/data/golden_scene.bin?inline";
import sceneContent from "../../../tests/data/golden_scene.json";
import { decodeBinary, decodeText, isScene } from "./protocol";
import type { FrameData, SceneData } from "./protocol";

type Content = typeof frameContent | typeof sceneContent;

/** Bytes of a file that was taken in as an address with its content. */
function bytesOf(address: string): ArrayBuffer {
  const [head, text] = address.split(",");
  if (!head?.endsWith(";base64") || text === undefined) throw new Error(`not a file taken in: ${address.slice(0, 60)}`);
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

/** A message as the server writes it. */
function encoded(header: object, data = new Uint8Array()): ArrayBuffer {
  let text = new TextEncoder().encode(JSON.stringify(header));
  text = new Uint8Array([...text, ...new Array<number>((8 - ((4 + text.length) % 8)) % 8).fill(32)]);
  const message = new Uint8Array(4 + text.length + data.length);
  new DataView(message.buffer).setUint32(0, text.length, true);
  message.set(text, 4);
  message.set(data, 4 + text.length);
  return message.buffer;
}

/** Every array of a decoded message under its name in the message. */
function arraysOf(data: SceneData | FrameData): Record<string, ArrayLike<number>> {
  const named = (groups: object[], prefix: string) =>
    groups.flatMap((arrays, i) => Object.entries(arrays).map(([name, array]) => [`${prefix}${i}/${name}`, array] as const));
  const bodies = Object.fromEntries(named(data.bodies, "")) as Record<string, ArrayLike<number>>;
  if (!isScene(data)) return { ...bodies, log: data.log, history: data.history };
  return { ...bodies, ...(Object.fromEntries(named(data.tools, "tools/")) as Record<string, ArrayLike<number>>) };
}

describe("the golden messages, which Python writes", () => {
  it.each<[string, string, Content]>([
    ["scene", goldenScene, sceneContent],
    ["frame", goldenFrame, frameContent],
  ])("hold every value: %s", (_kind, address, content) => {
    const data = decodeBinary(bytesOf(address));
    expect(data.header).toEqual(content.header);
    const expected = Object.entries(content.arrays).map(([name, { values }]) => [name, values]);
    const found = Object.entries(arraysOf(data)).map(([name, array]) => [name, Array.from(array)]);
    expect(Object.fromEntries(found)).toEqual(Object.fromEntries(expected));
  });

  it("are told apart", () => {
    expect(isScene(decodeBinary(bytesOf(goldenScene)))).toBe(true);
    expect(isScene(decodeBinary(bytesOf(goldenFrame)))).toBe(false);
  });

  it("are refused when anything is cut off", () => {
    const whole = bytesOf(goldenFrame);
    // The last array ends with its eight numbers of four bytes.
    expect(() => decodeBinary(whole.slice(0, -4))).toThrow("goes beyond its message");
    for (let length = 0; length < whole.byteLength; length += 7) {
      expect(() => decodeBinary(whole.slice(0, length))).toThrow();
    }
  });
});

describe("a malformed binary message", () => {
  const entry = { name: "0/scalar", dtype: "u1", shape: [4], offset: 0 };
  const frame = { type: "frame", bodies: [], tools: [], arrays: [] as object[] };

  it.each<[string, object, string]>([
    ["of another type", { ...frame, type: "picture" }, "unknown type"],
    ["without bodies", { ...frame, bodies: undefined }, "without bodies, tools or arrays"],
    ["without tools", { ...frame, tools: 1 }, "without bodies, tools or arrays"],
    ["without arrays", { ...frame, arrays: null }, "without bodies, tools or arrays"],
    ["of version 3", { type: "frame", tool: {}, force: [0, 0, 0], arrays: [] }, "without bodies, tools or arrays"],
    ["whose header is a list", [frame], "no object"],
    ["with an unknown kind of array", { ...frame, arrays: [{ ...entry, dtype: "f8" }] }, "unknown type 'f8'"],
    ["with an array beyond its end", { ...frame, arrays: [{ ...entry, shape: [9] }] }, "goes beyond its message"],
    ["with an array before its start", { ...frame, arrays: [{ ...entry, offset: -4 }] }, "goes beyond its message"],
    ["with an array of no place", { ...frame, arrays: [{ ...entry, offset: null, shape: [NaN] }] }, "goes beyond"],
    ["without the log", frame, "without the array 'log'"],
    ["without a body's pose", { ...frame, bodies: [{}], arrays: [entry] }, "without the array '0/displacements'"],
    [
      "with displacements of another kind",
      { ...frame, bodies: [{}], arrays: ["displacements", "scalar"].map((name) => ({ ...entry, name: `0/${name}` })) },
      "without the array '0/displacements'",
    ],
  ])("%s is refused", (_what, header, reason) => {
    expect(() => decodeBinary(encoded(header, new Uint8Array(8)))).toThrow(reason);
  });

  it("that is no JSON is refused", () => {
    expect(() => decodeBinary(new Uint8Array([4, 0, 0, 0, 123, 123, 123, 123]).buffer)).toThrow(SyntaxError);
  });
});

describe("a text message", () => {
  it("is read", () => {
    const settings = { type: "settings", youngs_modulus: [1e4, null], contact_radius: [0.004], time_scale: null };
    expect(decodeText(JSON.stringify(settings))).toEqual(settings);
  });

  it.each(["", "nonsense", "[]", "null", "5", "{}", '{"type": "frame"}', '{"type": ["role"]}', '{"type": null}'])(
    "is refused: %s",
    (text) => {
      expect(() => decodeText(text)).toThrow();
    },
  );
});
