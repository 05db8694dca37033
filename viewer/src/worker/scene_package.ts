// The packed scene of a page: one file, compressed, of the files that the program reads and what the page draws.

import { decodeArrays } from "../net/protocol";
import type { AnyArray, SettingsMessage, ToolMessage, Vec3 } from "../net/protocol";

/** A shape that a tool of the scene may take in place of its own. */
export interface PackedShape {
  /** The tool for the loop: an entry of `tools` in a packed scene. */
  description: object;
  /** What differs in its entry of the scene message. */
  entry: Partial<ToolMessage>;
  /** Its table of a scene file, for recordings. */
  table: object;
}

/** What the page has to know of a scene beside its picture; written by `palpate web`. */
export interface PageData {
  version: string;
  name: string;
  /** Of a recording. */
  about: Record<string, string>;
  settings: SettingsMessage;
  /** Middle of all bodies, and their longest side, m. */
  centre: Vec3;
  size: number;
  /** Of each tool, by their names. */
  shapes: Record<string, PackedShape>[];
  /** Largest contact radius of each tool, m. */
  max_radii: number[];
  bodies: { size: number; nodes_per_face: number; position: Vec3; orientation: [number, number, number, number] }[];
  motion: { body: number; watched: number; duration: number; max_impulse: number; strike: { point: Vec3; impulse: Vec3 } | null } | null;
}

export interface ScenePackage {
  data: PageData;
  arrays: Map<string, AnyArray>;
  /** The scene message. */
  scene: ArrayBuffer;
  /** What the program reads, by name. */
  files: Map<string, Uint8Array>;
}

const SCENE = "page/scene.bin";
const PAGE = "page/page.bin";

/** Fetches and unpacks a scene. */
export async function fetchPackage(url: string): Promise<ScenePackage> {
  const answer = await fetch(url);
  if (!answer.ok || !answer.body) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
  const stream = answer.body.pipeThrough(new DecompressionStream("gzip"));
  return readPackage(await new Response(stream).arrayBuffer());
}

/** Files of a package: a header of JSON with their names and sizes, then their bytes, each from a multiple of eight on. */
export function readPackage(buffer: ArrayBuffer): ScenePackage {
  const length = new DataView(buffer).getUint32(0, true);
  const entries = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length))) as { name: string; size: number }[];
  const files = new Map<string, Uint8Array>();
  let at = (4 + length + 7) & ~7;
  for (const { name, size } of entries) {
    files.set(name, new Uint8Array(buffer, at, size));
    at = (at + size + 7) & ~7;
  }
  const take = (name: string): ArrayBuffer => {
    const bytes = files.get(name);
    if (!bytes) throw new Error(`the scene has no '${name}'`);
    files.delete(name);
    return bytes.slice().buffer;
  };
  const { header, arrays } = decodeArrays(take(PAGE));
  return { data: header as unknown as PageData, arrays, scene: take(SCENE), files };
}
