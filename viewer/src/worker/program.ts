// The WebAssembly module: calls, and their texts and numbers in its memory. Its functions are in crates/web/src/exports.rs.

import type { FrameMessage, Vec3 } from "../net/protocol";

interface Exports {
  memory: WebAssembly.Memory;
  palpate_alloc(length: number): number;
  palpate_free(pointer: number, length: number): void;
  palpate_provide(name: number, nameLength: number, bytes: number, length: number): void;
  palpate_open(): number;
  palpate_command(text: number, length: number): number;
  palpate_advance(nowMs: number): number;
  palpate_frame(): number;
  palpate_displacements(body: number): number;
  palpate_log(body: number): number;
  palpate_run(positions: number, count: number): number;
  palpate_end_recording(): number;
  palpate_text(): number;
  palpate_text_length(): number;
  palpate_numbers(): number;
  palpate_numbers_length(): number;
}

/** The latest tick, without its arrays: what a frame has of it, and what the worker makes the rest of. */
export type Tick = Pick<
  FrameMessage,
  "time" | "tools" | "contacts" | "compute_us" | "wakeup_us" | "ticks" | "missed_deadlines" | "fault" | "realtime"
> & {
  recorded: { ticks: number; error: string | null } | null;
  body_time: number[];
};

export type Command =
  | { do: "press"; tool: number; position: Vec3; orientation?: readonly number[]; grab: boolean }
  | { do: "release"; tool: number }
  | { do: "set"; name: string; rank: number; value: number }
  | { do: "tool"; tool: number; description?: object | undefined }
  | { do: "reset" }
  | { do: "strike"; body: number; point: Vec3; impulse: Vec3; duration: number }
  | { do: "watch"; body: number; node: number }
  | { do: "record"; about: Record<string, string>; begun_ms: number };

export class Program {
  private constructor(private readonly exports: Exports) {}

  static async load(module: WebAssembly.Module, now: () => number): Promise<Program> {
    const instance = await WebAssembly.instantiate(module, { palpate: { now_ms: now } });
    return new Program(instance.exports as unknown as Exports);
  }

  provide(name: string, bytes: Uint8Array): void {
    this.within(new TextEncoder().encode(name), (at, length) => {
      this.within(bytes, (from, count) => this.exports.palpate_provide(at, length, from, count));
    });
  }

  open(): void {
    this.check(this.exports.palpate_open());
  }

  command(command: Command): void {
    const text = new TextEncoder().encode(JSON.stringify(command));
    this.check(this.within(text, (at, length) => this.exports.palpate_command(at, length)));
  }

  /** Makes the ticks that are due; how many. */
  advance(nowMs: number): number {
    return this.exports.palpate_advance(nowMs);
  }

  tick(): Tick {
    this.check(this.exports.palpate_frame());
    return JSON.parse(this.text()) as Tick;
  }

  displacements(body: number): Float64Array {
    this.check(this.exports.palpate_displacements(body));
    return this.numbers();
  }

  /** Rows of eleven numbers: see `frame.rs`. */
  log(body: number): Float64Array {
    this.check(this.exports.palpate_log(body));
    return this.numbers();
  }

  run(positions: Float64Array): Float64Array {
    const bytes = new Uint8Array(positions.buffer, positions.byteOffset, positions.byteLength);
    this.check(this.within(bytes, (at) => this.exports.palpate_run(at, positions.length)));
    return this.numbers();
  }

  endRecording(): Uint8Array {
    this.check(this.exports.palpate_end_recording());
    return this.bytes();
  }

  private within<T>(bytes: Uint8Array, use: (at: number, length: number) => T): T {
    const at = this.exports.palpate_alloc(bytes.length);
    new Uint8Array(this.exports.memory.buffer).set(bytes, at);
    const used = use(at, bytes.length);
    this.exports.palpate_free(at, bytes.length);
    return used;
  }

  private check(status: number): void {
    if (status < 0) throw new Error(this.text());
  }

  private text(): string {
    return new TextDecoder().decode(this.bytes());
  }

  private bytes(): Uint8Array {
    const at = this.exports.palpate_text();
    return new Uint8Array(this.exports.memory.buffer, at, this.exports.palpate_text_length()).slice();
  }

  private numbers(): Float64Array {
    const at = this.exports.palpate_numbers();
    return new Float64Array(this.exports.memory.buffer, at, this.exports.palpate_numbers_length()).slice();
  }
}
