// Messages of the websocket, version 3. Lengths in m, forces in N, times in s unless a name says otherwise.
// A binary message is: uint32 header length L (little endian), L bytes of JSON, raw little-endian arrays. The server pads
// the JSON so that every array starts at a multiple of eight bytes and can be viewed without a copy.

export const PROTOCOL_VERSION = 3;

export type Vec3 = [number, number, number];
export type Role = "control" | "watch";

export interface Percentiles {
  p50: number;
  p99: number;
  p999: number;
  max: number;
}

export interface SceneMessage {
  type: "scene";
  name: string;
  title: string;
  nodes: number;
  tets: number;
  surface_nodes: number;
  triangles: number;
  youngs_modulus: number | null;
  poissons_ratio: number;
  contact_radius: number;
  max_contact_radius: number;
  tool_radius: number;
  max_force: number;
  size: number;
  /** A tool is held back where the body would be strained more; 0 for never. */
  hold_strain: number;
  fields: { name: string; title: string }[];
  motion: MotionScene | null;
  view: { position: Vec3; target: Vec3 } | null;
}

/** Of a body that moves. */
export interface MotionScene {
  /** Hz, of the lowest modes. */
  frequencies: number[];
  /** How many modes there are. */
  modes: number;
  /** Seconds that it moves in a second. */
  time_scale: number;
  /** A blow that the body stands well, and the strongest that is taken, N s. */
  impulse: number;
  max_impulse: number;
  /** Body time that the plots of the motion show, s. */
  span: number;
  youngs_modulus: number | null;
  /** The scene's own blow, N s. */
  strike: { point: Vec3; impulse: Vec3 } | null;
}

export interface SceneArrays {
  nodes: Float32Array;
  tets: Uint32Array;
  surface_triangles: Uint32Array;
  surface_nodes: Uint32Array;
  fixed_nodes: Uint32Array;
  /** Displacements of the surface under the body's own loads, a row for each surface node. */
  free: Float32Array;
}

export interface ContactMessage {
  mode: "press" | "grab";
  /** On the rest surface. */
  point: Vec3;
  normal: Vec3;
  /** On the body. */
  force: Vec3;
}

/** What the colours show. `scalar` goes from 0 (or from -max if signed) to max, in units of mm, % or Pa. */
export interface FieldMessage {
  name: string;
  title: string;
  unit: "mm" | "%" | "Pa";
  max: number;
  signed: boolean;
}

/** A mode shape that is drawn in place of the motion, counted from 1; amplitude is its largest displacement. */
export interface ModeMessage {
  number: number;
  frequency: number;
  shown_hz: number;
  amplitude: number;
}

export interface MotionFrame {
  /** Surface node, by its row, whose displacement is in the history. */
  watched: number;
  /** Body time of the last blow, until something else touches the body. */
  struck_at: number | null;
  mode: ModeMessage | null;
}

export interface FrameMessage {
  type: "frame";
  frame: number;
  time: number;
  /** wanted is where the pointer is while the tool is held back. */
  tool: { position: Vec3; active: boolean; wanted: Vec3 | null };
  /** On the device. */
  force: Vec3;
  contacts: ContactMessage[];
  compute_us: Percentiles;
  wakeup_us: Percentiles;
  ticks: number;
  missed_deadlines: number;
  fault: string | null;
  realtime: boolean;
  strain: number;
  motion: MotionFrame | null;
  field: FieldMessage;
  interior: boolean;
}

/** A row of displacements and scalar is a surface node, or any node if the inside is shown. */
export interface FrameArrays {
  displacements: Float32Array;
  scalar: Uint8Array;
  log: Float32Array;
  /** Body time, displacement of the watched node, kinetic, strain and total energy in J, work on the body since the start. */
  history: Float32Array;
}

export interface SceneData {
  header: SceneMessage;
  arrays: SceneArrays;
}

export interface FrameData {
  header: FrameMessage;
  arrays: FrameArrays;
}

export type TextMessage =
  | { type: "welcome"; role: Role; version: string; models: { name: string; title: string }[] }
  | { type: "role"; role: Role }
  | { type: "settings"; youngs_modulus: number | null; contact_radius: number; time_scale: number | null }
  | { type: "status"; text: string; progress: number | null; left_s: number | null }
  | { type: "error"; text: string };

export type ClientMessage =
  | { type: "hello"; token: string; version: number }
  | { type: "press"; position: Vec3; grab: boolean }
  | { type: "release" }
  | { type: "set"; youngs_modulus: number }
  | { type: "set"; contact_radius: number }
  | { type: "set"; time_scale: number }
  | { type: "reset" }
  | { type: "strike"; point: Vec3; impulse: Vec3 }
  | { type: "repeat" }
  | { type: "mode"; number: number }
  | { type: "model"; name: string }
  | { type: "cutaway"; on: boolean }
  | { type: "field"; name: string }
  | { type: "ack"; frame: number };

interface ArrayEntry {
  name: string;
  dtype: "f4" | "u4" | "u1";
  shape: number[];
  offset: number;
}

type AnyArray = Float32Array | Uint32Array | Uint8Array;

/** Views an array of a binary message in place. */
function viewArray(buffer: ArrayBuffer, start: number, entry: ArrayEntry): AnyArray {
  const count = entry.shape.reduce((product, extent) => product * extent, 1);
  const offset = start + entry.offset;
  switch (entry.dtype) {
    case "f4":
      return new Float32Array(buffer, offset, count);
    case "u4":
      return new Uint32Array(buffer, offset, count);
    case "u1":
      return new Uint8Array(buffer, offset, count);
  }
}

/** Reads a scene or a frame; throws on a message that is neither, or that is shorter than it says. */
export function decodeBinary(buffer: ArrayBuffer): SceneData | FrameData {
  const headerLength = new DataView(buffer).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, headerLength));
  const header = JSON.parse(text) as (SceneMessage | FrameMessage) & { arrays: ArrayEntry[] };
  if (header.type !== "scene" && header.type !== "frame") throw new Error("a binary message of an unknown type");
  const arrays = Object.fromEntries(
    header.arrays.map((entry) => [entry.name, viewArray(buffer, 4 + headerLength, entry)]),
  );
  return { header, arrays } as unknown as SceneData | FrameData;
}

export function isScene(data: SceneData | FrameData): data is SceneData {
  return data.header.type === "scene";
}
