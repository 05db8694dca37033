// Messages of the websocket, version 12. Lengths in m, forces in N, times in s unless a name says otherwise. Vectors are in
// the frame of the scene, but for what belongs to one body: its arrays, places of contacts and of strikes are in its own.
// A binary message is: uint32 header length L (little endian), L bytes of JSON, raw little-endian arrays. The server pads
// the JSON so that every array starts at a multiple of eight bytes and can be viewed without a copy. An array of one body
// is named "<index of the body>/<what it is>", one of a tool "tools/<index of the tool>/<what it is>".

import type { ComputedMessage, PaintMessage } from "./computed_messages";
import type { SetupCommand, SetupMessage, UploadedMessage } from "./setup_messages";
import type { RecordedMessage, RecordingStatus, ReplayFrame, ReplayScene, SessionCommand } from "./session_messages";

export const PROTOCOL_VERSION = 12;

export type Vec3 = [number, number, number];
/** w x y z, of length one. */
export type Quaternion = [number, number, number, number];
export type Role = "control" | "watch";

/** Something to choose from a list. */
export interface Choice {
  name: string;
  title: string;
}

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
  /** Longest side of what all bodies fill. */
  size: number;
  /** A tool is held where a body would be strained more; 0 for never. */
  strain_limit: number;
  /** What the settings are reset to. */
  defaults: Pick<SettingsMessage, "youngs_modulus" | "contact_radius" | "friction" | "strain_limit">;
  /** Of every tool. */
  max_force: number;
  bodies: BodyMessage[];
  tools: ToolMessage[];
  motion: MotionScene | null;
  view: { position: Vec3; target: Vec3 } | null;
  /** Where a recording is shown and nothing runs. */
  replay: ReplayScene | null;
}

export interface BodyMessage {
  name: string;
  title: string;
  nodes: number;
  tets: number;
  surface_nodes: number;
  triangles: number;
  /** Where fewer triangles are drawn than there are: how many, and about how far the surface lies from them at rest, m. */
  drawn: { triangles: number; deviation: number } | null;
  /** null where it cannot be changed. */
  youngs_modulus: number | null;
  poissons_ratio: number | null;
  /** Of the body's frame. */
  position: Vec3;
  orientation: Quaternion;
  fields: Choice[];
  /** Fields that a server alone can show. */
  server_fields: Choice[];
  /** Empty for a bare store. */
  regions: RegionMessage[];
}

/** A part of a body with one material: Pa, kg/m^3. */
export interface RegionMessage {
  title: string;
  youngs_modulus: number;
  poissons_ratio: number;
  density: number;
}

export type ShapeName = "sphere" | "ellipsoid" | "capsule" | "punch" | "surface";

export interface ToolMessage {
  shape: ShapeName;
  /** Radius of a sphere; semi-axes of an ellipsoid; radius of a capsule or punch, then length or rounding; else zeros. */
  lengths: Vec3;
  /** Half of its smallest extent. */
  radius: number;
  /** The device that moves it; null for one that the pointer does. */
  device: string | null;
  /** The shapes that it may take. */
  shapes: Choice[];
  /** The law of its contacts: "local" slides and rubs, the others hold on to what they touch. */
  contact: "local" | "patch" | "node";
  /** Coefficient of friction. */
  friction: number;
  contact_radius: number;
  max_contact_radius: number;
}

/** Of a body that moves. */
export interface MotionScene {
  /** Which one it is. */
  body: number;
  /** Hz, of the lowest modes. */
  frequencies: number[];
  /** How many modes there are. */
  modes: number;
  /** Seconds that it moves in a second. */
  time_scale: number;
  /** An impulse that the body stands well, and the strongest that is taken, N s. */
  impulse: number;
  max_impulse: number;
  /** Body time that the plots of the motion show, s. */
  span: number;
  youngs_modulus: number | null;
  /** The scene's own strike, N s, in the body's frame. */
  strike: { point: Vec3; impulse: Vec3 } | null;
}

/**
 * Geometry of one body, in its frame. Where fewer triangles are drawn than the surface has, nodes are the vertices that are
 * drawn, each a node of the surface, and it has no tetrahedra.
 */
const BODY_ARRAYS = {
  nodes: Float32Array,
  tets: Uint32Array,
  /** Of each tetrahedron, among the body's regions. */
  tet_regions: Uint32Array,
  surface_triangles: Uint32Array,
  /** Of each triangle, the region behind it among the body's. */
  triangle_regions: Uint32Array,
  surface_nodes: Uint32Array,
  fixed_nodes: Uint32Array,
  /** Displacements of the surface under the body's own loads, a row for each surface node. */
  free: Float32Array,
  /** For each node of the whole surface the vertex that is drawn in its place; empty where all are drawn. */
  owners: Uint32Array,
};
export type BodyArrays = ArraysOf<typeof BODY_ARRAYS>;

/** Surface of a tool from a file, in its frame; empty for the other shapes. */
const TOOL_ARRAYS = { vertices: Float32Array, triangles: Uint32Array };
export type ToolArrays = ArraysOf<typeof TOOL_ARRAYS>;

export interface ToolFrame {
  position: Vec3;
  orientation: Quaternion;
  active: boolean;
  /** Whether the tool is not let go where the device is. */
  limited: boolean;
  /** Where the device is while the tool is limited. */
  wanted: Vec3 | null;
  /** On the device. */
  force: Vec3;
  /** Why there is no contact, where one was refused. */
  refused: string | null;
  /** Whether the body below the contact is thinner than 1.5 radii of the tool: the force is then too small. */
  thin: boolean;
}

export interface ContactMessage {
  tool: number;
  body: number;
  mode: "press" | "grab";
  /** On the rest surface, in the body's frame. */
  point: Vec3;
  normal: Vec3;
  /** On the body, in the frame of the scene. */
  force: Vec3;
  /** Of the area of contact, m. */
  radius: number;
  /** How far the tool has come from its first touch with the untouched surface, m; null where it holds on by its patch. */
  depth: number | null;
  /** Of the force along the normal against that depth, N/m. */
  stiffness: number | null;
  /** Whether all of the contact slides. */
  slipping: boolean;
  /** Estimated relative error of the force; null for a linear material. */
  error: number | null;
}

/**
 * What the colours show. `scalar` goes from min (or from -max if signed) to max, in the unit; what is beyond it is at the
 * end. With gaps it begins at 1, and 0 stands where nothing is known. `largest` is the largest magnitude in the frame.
 */
export interface FieldMessage {
  name: string;
  title: string;
  unit: "mm" | "%" | "Pa" | "N/m";
  signed: boolean;
  gaps: boolean;
  min: number;
  max: number;
  largest: number;
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
  /** Body time of the last strike, until something else touches the body. */
  struck_at: number | null;
  mode: ModeMessage | null;
}

export interface FrameMessage {
  type: "frame";
  frame: number;
  time: number;
  tools: ToolFrame[];
  contacts: ContactMessage[];
  compute_us: Percentiles;
  wakeup_us: Percentiles;
  ticks: number;
  missed_deadlines: number;
  fault: string | null;
  realtime: boolean;
  /** The largest over all bodies, and that of each. */
  strain: number;
  bodies: { strain: number }[];
  motion: MotionFrame | null;
  /** For each body, what its colours show and whether all of its nodes are sent. */
  fields: FieldMessage[];
  interior: boolean[];
  recording: RecordingStatus | null;
  /** With the settings of the tick. */
  replay: (ReplayFrame & { settings: SettingsMessage }) | null;
  /** In an exam, of the tone that stands for the force, from 0 to 1 in proportion to it. */
  loudness?: number;
}

export interface SceneData {
  header: SceneMessage;
  bodies: BodyArrays[];
  tools: ToolArrays[];
}

/** Of one body: a row of displacements, m, and scalar is a surface node, or any node if the inside is shown. */
const POSE_ARRAYS = { displacements: Float32Array, scalar: Uint8Array };
export type PoseArrays = ArraysOf<typeof POSE_ARRAYS>;

export interface FrameData {
  header: FrameMessage;
  bodies: PoseArrays[];
  /** Rows of time, force of the first tool, computing time in us. */
  log: Float32Array;
  /** Body time, displacement of the watched node, kinetic, strain and total energy in J, work on the body since the start. */
  history: Float32Array;
}

export interface SettingsMessage {
  type: "settings";
  /** Of each body. */
  youngs_modulus: (number | null)[];
  /** Of each tool. */
  contact_radius: number[];
  friction: number[];
  shape: ShapeName[];
  /** 0 for none. */
  strain_limit: number;
  time_scale: number | null;
}

/** How far a long work is; an empty text when it has ended. */
export interface StatusMessage {
  type: "status";
  text: string;
  progress: number | null;
  left_s: number | null;
}

/** Where an exam stands. */
export interface ExamMessage {
  type: "exam";
  /** From 1. */
  trial: number;
  trials: number;
  /** Points of the surface, one of which may be above a nodule, in the frame of the scene; none where they are not told. */
  places: Vec3[];
  /** After the last answer: what it comes to in words, and a picture as an address with its content. */
  result: { lines: string[]; plot: string } | null;
}

export type TextMessage =
  | { type: "welcome"; role: Role; version: string; models: Choice[] }
  | { type: "role"; role: Role }
  | SettingsMessage
  | StatusMessage
  | RecordedMessage
  | ExamMessage
  | ComputedMessage
  | SetupMessage
  | UploadedMessage
  | { type: "error"; text: string };

export type ClientMessage =
  | { type: "hello"; token: string; version: number }
  | { type: "press"; tool: number; position: Vec3; grab: boolean; orientation?: Quaternion }
  | { type: "release"; tool?: number }
  | { type: "set"; youngs_modulus: number; body: number }
  | { type: "set"; contact_radius: number; tool?: number }
  | { type: "set"; friction: number; tool?: number }
  | { type: "set"; strain_limit: number }
  | { type: "set"; time_scale: number }
  | { type: "shape"; tool: number; name: string }
  | { type: "reset" }
  | { type: "strike"; body: number; point: Vec3; impulse: Vec3 }
  | { type: "repeat" }
  | { type: "mode"; number: number }
  | { type: "model"; name: string }
  | { type: "cancel" }
  | { type: "cutaway"; on: boolean }
  | { type: "field"; name: string; max?: number }
  | { type: "answer"; found: boolean }
  | { type: "ack"; frame: number }
  | PaintMessage
  | SetupCommand
  | SessionCommand;

const TEXT_TYPES = ["welcome", "role", "settings", "status", "recorded", "exam", "computed", "setup", "uploaded", "error"];

interface ArrayEntry {
  name: string;
  dtype: string;
  shape: number[];
  offset: number;
}

export type AnyArray = Float32Array | Uint32Array | Uint8Array;
type ArrayKind = new (buffer: ArrayBuffer, offset: number, length: number) => AnyArray;
/** What a table of names and kinds stands for: arrays of these kinds by these names. */
type ArraysOf<Kinds extends Record<string, ArrayKind>> = { [Name in keyof Kinds]: InstanceType<Kinds[Name]> };
const KINDS: Record<string, ArrayKind & { BYTES_PER_ELEMENT: number }> = {
  f4: Float32Array,
  u4: Uint32Array,
  u1: Uint8Array,
};

/** Reads a text message; throws on anything else. */
export function decodeText(text: string): TextMessage {
  const message: unknown = JSON.parse(text);
  const type = isRecord(message) ? message["type"] : undefined;
  if (typeof type !== "string" || !TEXT_TYPES.includes(type)) throw new Error("a text message of an unknown type");
  return message as TextMessage;
}

/** Header and arrays of any binary message, the arrays viewed in place. */
export function decodeArrays(buffer: ArrayBuffer): { header: Record<string, unknown>; arrays: Map<string, AnyArray> } {
  const { header, start } = readHeader(buffer);
  const entries = header["arrays"];
  if (!Array.isArray(entries)) throw new Error("a binary message without arrays");
  return { header, arrays: new Map((entries as ArrayEntry[]).map((entry) => [entry.name, viewArray(buffer, start, entry)])) };
}

/** A binary message as the server writes them. */
export function encodeArrays(header: object, arrays: Record<string, AnyArray>): ArrayBuffer {
  const kinds: [AnyArray, string][] = Object.values(arrays).map((array) => [array, dtypeOf(array)]);
  let offset = 0;
  const entries = Object.keys(arrays).map((name, i) => {
    const [array, dtype] = kinds[i]!;
    const entry = { name, dtype, shape: [array.length], offset };
    offset += (array.byteLength + 7) & ~7;
    return entry;
  });
  const text = new TextEncoder().encode(JSON.stringify({ ...header, arrays: entries }));
  const length = ((4 + text.length + 7) & ~7) - 4;
  const bytes = new Uint8Array(4 + length + offset).fill(0x20, 4, 4 + length);
  new DataView(bytes.buffer).setUint32(0, length, true);
  bytes.set(text, 4);
  kinds.forEach(([array], i) => {
    bytes.set(new Uint8Array(array.buffer, array.byteOffset, array.byteLength), 4 + length + entries[i]!.offset);
  });
  return bytes.buffer;
}

function dtypeOf(array: AnyArray): string {
  if (array instanceof Float32Array) return "f4";
  return array instanceof Uint32Array ? "u4" : "u1";
}

/** Reads a scene or a frame; throws on a message that is neither, lacks an array, or is shorter than it says. */
export function decodeBinary(buffer: ArrayBuffer): SceneData | FrameData {
  const { header, start } = readHeader(buffer);
  const { type, bodies, tools, arrays: entries } = header;
  if (type !== "scene" && type !== "frame") throw new Error("a binary message of an unknown type");
  if (!Array.isArray(bodies) || !Array.isArray(tools) || !Array.isArray(entries)) {
    throw new Error(`a ${type} without bodies, tools or arrays`);
  }
  const arrays = new Map<string, AnyArray>();
  for (const entry of entries as ArrayEntry[]) arrays.set(entry.name, viewArray(buffer, start, entry));
  delete header["arrays"];
  if (type === "scene") {
    return {
      header: header as unknown as SceneMessage,
      bodies: bodies.map((_, i) => group(arrays, `${i}/`, BODY_ARRAYS)),
      tools: tools.map((_, i) => group(arrays, `tools/${i}/`, TOOL_ARRAYS)),
    };
  }
  return {
    header: header as unknown as FrameMessage,
    bodies: bodies.map((_, i) => group(arrays, `${i}/`, POSE_ARRAYS)),
    ...group(arrays, "", { log: Float32Array, history: Float32Array }),
  };
}

export function isScene(data: SceneData | FrameData): data is SceneData {
  return data.header.type === "scene";
}

function readHeader(buffer: ArrayBuffer): { header: Record<string, unknown>; start: number } {
  if (buffer.byteLength < 4) throw new Error("a binary message without a header");
  const length = new DataView(buffer).getUint32(0, true);
  if (4 + length > buffer.byteLength) throw new Error("a binary message shorter than its header");
  const header: unknown = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  if (!isRecord(header)) throw new Error("a binary message whose header is no object");
  return { header, start: 4 + length };
}

/** Views an array of a binary message in place. */
function viewArray(buffer: ArrayBuffer, start: number, { name, dtype, shape, offset }: ArrayEntry): AnyArray {
  const kind = KINDS[dtype];
  if (!kind) throw new Error(`array '${name}' of an unknown type '${dtype}'`);
  const whole = [offset, ...shape].every((value) => Number.isSafeInteger(value) && value >= 0);
  const count = shape.reduce((product, extent) => product * extent, 1);
  const end = start + offset + count * kind.BYTES_PER_ELEMENT;
  if (!whole || end > buffer.byteLength) throw new Error(`array '${name}' goes beyond its message`);
  return new kind(buffer, start + offset, count);
}

/** Arrays whose names have a prefix, each of the kind that it must have. */
function group<Kinds extends Record<string, ArrayKind>>(
  arrays: Map<string, AnyArray>,
  prefix: string,
  kinds: Kinds,
): ArraysOf<Kinds> {
  const entries = Object.entries(kinds).map(([name, kind]) => {
    const array = arrays.get(prefix + name);
    if (!(array instanceof kind)) throw new Error(`a message without the array '${prefix}${name}'`);
    return [name, array];
  });
  return Object.fromEntries(entries) as ArraysOf<Kinds>;
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}
