// The session of one page without a server: answers its messages as the server would, on the loop in WebAssembly.

import { encodeArrays } from "../net/protocol";
import type { Choice, ClientMessage, MotionFrame, SettingsMessage, ShapeName, Vec3 } from "../net/protocol";
import { OfferedTools } from "./offered_tools";
import { BodyPicture, isComputed } from "./picture";
import type { FieldName } from "./picture";
import type { Program, Tick } from "./program";
import type { ScenePackage } from "./scene_package";
import { WatchedNode } from "./watched_node";

/** Numbers of a row of the log. */
const ROW = 11;
/** Rows of the log that a frame carries at most. */
const LOG_SENT = 64;
/** Targets farther than so many body sizes from the bodies are refused. */
const REACH = 10;
/** Shortest time between two frames, ms. */
const FRAME_MS = 14;

export interface Replies {
  message(data: string | ArrayBuffer): void;
  file(name: string, bytes: ArrayBuffer): void;
}

export class WorkerSession {
  private readonly pictures: BodyPicture[];
  private settings: SettingsMessage;
  private view = { field: "displacement" as FieldName, max: null as number | null, cutaway: false };
  private frame = 0;
  /** Whether the page has shown the last frame. */
  private answered = true;
  private sentMs = -Infinity;
  private log: number[] = [];
  private history: number[] = [];
  private bodyTime = 0;
  private motion: MotionFrame | null;
  private readonly watched: WatchedNode | null;
  private begun = 0;
  private readonly tools: OfferedTools;

  constructor(
    private readonly program: Program,
    private readonly scene: ScenePackage,
    private readonly replies: Replies,
    /** Other scenes that the page may ask for. */
    models: Choice[],
  ) {
    const { data, arrays } = scene;
    this.pictures = data.bodies.map((body, i) => new BodyPicture(arrays, i, body.nodes_per_face, body.size));
    this.settings = data.settings;
    this.tools = new OfferedTools(data, scene.scene);
    const array = (name: string) => arrays.get(`${data.motion!.body}/${name}`)!;
    this.watched = data.motion
      ? new WatchedNode(array("positions") as Float32Array, array("drawn") as Uint32Array, data.motion.watched)
      : null;
    this.motion = this.begin();
    this.text({ type: "welcome", role: "control", version: data.version, models });
    replies.message(this.tools.sceneMessage());
    this.text(this.settings);
  }

  /** Saves a recording under way. */
  close(): void {
    if (this.program.tick().recorded) this.record(false);
  }

  /** A loop that begins: what it watches, its pace; the motion of its frames. */
  private begin(): MotionFrame | null {
    const { settings, watched } = this;
    if (settings.time_scale !== null) this.apply("time_scale", 0, settings.time_scale);
    if (!watched) return null;
    this.watch(watched);
    return { watched: watched.row, struck_at: null, mode: null };
  }

  private watch(watched: WatchedNode): void {
    this.program.command({ do: "watch", body: this.scene.data.motion!.body, node: watched.node });
    if (this.motion) this.motion = { ...this.motion, watched: watched.row };
  }

  /** Makes the ticks that are due, and a frame if the page has shown the last one. */
  wake(nowMs: number): void {
    this.program.advance(nowMs);
    if (!this.answered || nowMs - this.sentMs < FRAME_MS) return;
    this.answered = false;
    this.sentMs = nowMs;
    this.sendFrame(nowMs);
  }

  /** Does what the page asks for; what is refused is answered by its reason. */
  handle(message: ClientMessage): void {
    try {
      this.dispatch(message);
    } catch (error) {
      this.text({ type: "error", text: error instanceof Error ? error.message : String(error) });
    }
  }

  private dispatch(message: ClientMessage): void {
    const { program } = this;
    switch (message.type) {
      case "press":
        this.requireNear("press", message.position);
        if (this.motion) this.motion = { ...this.motion, struck_at: null };
        return program.command({
          do: "press",
          tool: message.tool,
          position: message.position,
          grab: message.grab,
          ...(message.orientation && { orientation: message.orientation }),
        });
      case "release":
        for (const tool of message.tool === undefined ? this.settings.friction.keys() : [message.tool]) {
          program.command({ do: "release", tool });
        }
        return;
      case "set":
        return this.set(message);
      case "reset":
        return this.reset();
      case "strike":
        return this.strike(message.point, message.impulse, message.body);
      case "repeat": {
        const strike = this.scene.data.motion?.strike;
        if (!strike) throw new Error("repeat: the scene has no strike of its own");
        return this.strike(strike.point, strike.impulse, this.scene.data.motion!.body);
      }
      case "shape":
        return this.shape(message.tool, message.name);
      case "record":
        return this.record(message.on);
      case "cutaway":
        this.view.cutaway = message.on;
        return;
      case "field":
        if (!isComputed(message.name)) throw new Error(`the field '${message.name}' needs Palpate on this computer: pip install palpate`);
        this.view = { ...this.view, field: message.name, max: message.max ?? null };
        return;
      case "ack":
        this.answered = true;
        return;
      case "hello":
      case "cancel":
        return;
      case "answer":
      case "edit":
      case "hold":
      case "mode":
      case "model":
      case "paint":
      case "replay":
      case "save":
      case "setup":
      case "touch":
      case "upload":
        throw new Error(`${NEEDS_SERVER[message.type] ?? "This"} needs Palpate on this computer: pip install palpate`);
    }
  }

  private set(message: Extract<ClientMessage, { type: "set" }>): void {
    const { settings, scene } = this;
    if ("youngs_modulus" in message) {
      const first = scene.data.settings.youngs_modulus[message.body];
      if (first == null) throw new Error("the stiffness of this body cannot be changed");
      this.apply("stiffness_scale", message.body, message.youngs_modulus / first);
      this.settings = { ...settings, youngs_modulus: settings.youngs_modulus.with(message.body, message.youngs_modulus) };
    } else if ("contact_radius" in message) {
      const tool = message.tool ?? 0;
      const largest = scene.data.max_radii[tool]!;
      if (message.contact_radius > largest) throw new Error(`the contact radius goes up to ${(1e3 * largest).toPrecision(3)} mm on this body`);
      this.apply("contact_radius", tool, message.contact_radius);
      this.settings = { ...settings, contact_radius: settings.contact_radius.with(tool, message.contact_radius) };
    } else if ("friction" in message) {
      this.apply("friction", message.tool ?? 0, message.friction);
      this.settings = { ...settings, friction: settings.friction.with(message.tool ?? 0, message.friction) };
    } else if ("strain_limit" in message) {
      this.apply("strain_limit", 0, message.strain_limit);
      this.settings = { ...settings, strain_limit: message.strain_limit };
    } else {
      this.apply("time_scale", 0, message.time_scale);
      this.settings = { ...settings, time_scale: message.time_scale };
    }
    this.text(this.settings);
  }

  /** Another loop on the same bodies, with the settings of now. */
  private shape(tool: number, name: string): void {
    if (name === this.settings.shape[tool]) return;
    this.close();
    this.program.command({ do: "tool", tool, description: this.tools.choose(tool, name) });
    const { settings } = this;
    this.settings = { ...settings, shape: settings.shape.with(tool, name as ShapeName) };
    this.applyAll(settings);
    [this.log, this.history, this.bodyTime] = [[], [], 0];
    this.motion = this.begin();
    this.replies.message(this.tools.sceneMessage());
    this.text(this.settings);
  }

  private apply(name: string, rank: number, value: number): void {
    this.program.command({ do: "set", name, rank, value });
  }

  /** Gives the loop all settings but the pace of a body, which it has at the beginning. */
  private applyAll({ contact_radius, friction, youngs_modulus, strain_limit }: SettingsMessage): void {
    contact_radius.forEach((radius, tool) => this.apply("contact_radius", tool, radius));
    friction.forEach((value, tool) => this.apply("friction", tool, value));
    youngs_modulus.forEach((modulus, body) => {
      const first = this.scene.data.settings.youngs_modulus[body];
      if (modulus !== null && first) this.apply("stiffness_scale", body, modulus / first);
    });
    this.apply("strain_limit", 0, strain_limit);
  }

  private reset(): void {
    const first = this.scene.data.settings;
    this.settings.friction.forEach((_, tool) => this.program.command({ do: "release", tool }));
    this.applyAll(first);
    this.program.command({ do: "reset" });
    this.settings = { ...first, time_scale: this.settings.time_scale, shape: this.settings.shape };
    this.text(this.settings);
  }

  /** Point and impulse in the frame of the body. */
  private strike(point: Vec3, impulse: Vec3, body: number): void {
    const motion = this.scene.data.motion;
    if (!motion || body !== motion.body || !this.motion) throw new Error("strike: this body does not move");
    const size = Math.hypot(...impulse);
    if (!(size > 0 && size <= motion.max_impulse)) {
      throw new Error(`strike: the impulse must lie between 0 and ${motion.max_impulse.toPrecision(3)} N s on this body`);
    }
    const placed = this.scene.data.bodies[body]!;
    const where = rotated(point, placed.orientation).map((x, k) => x + placed.position[k]!) as Vec3;
    this.program.command({ do: "strike", body, point: where, impulse: rotated(impulse, placed.orientation), duration: motion.duration });
    this.motion = { ...this.motion, struck_at: this.bodyTime };
    this.watched!.watch(point);
    this.watch(this.watched!);
  }

  private record(on: boolean): void {
    if (on) {
      this.begun = Date.now();
      this.program.command({ do: "record", about: this.tools.about(), begun_ms: this.begun });
      return;
    }
    const { ticks } = this.program.tick().recorded ?? { ticks: 0 };
    const bytes = this.program.endRecording();
    const path = `${this.scene.data.name}-${stamp(new Date(this.begun))}.mcap`;
    this.replies.file(path, bytes.buffer as ArrayBuffer);
    const status = { path, ticks, seconds: ticks / Number(this.scene.data.about["rate"]), size: bytes.length, dropped: 0, error: null };
    this.text({ type: "recorded", ...status, replay: `palpate replay ${path}`, reason: null });
  }

  private sendFrame(nowMs: number): void {
    const { program, view, scene } = this;
    const tick = program.tick();
    if (this.watched?.follow(tick.contacts, scene.data.motion!.body)) this.watch(this.watched);
    this.takeLog();
    const pictures = this.pictures.map((picture, body) =>
      picture.picture(program.displacements(body), view.field, view.max, view.cutaway, nowMs),
    );
    this.frame += 1;
    const header = {
      type: "frame",
      frame: this.frame,
      ...this.recordedFields(tick),
      strain: Math.max(...pictures.map(({ strain }) => strain)),
      bodies: pictures.map(({ strain }) => ({ strain })),
      motion: this.motion,
      fields: pictures.map(({ field }) => field),
      interior: pictures.map(({ interior }) => interior),
      recording: this.recording(tick, Number(scene.data.about["rate"])),
      replay: null,
    };
    const arrays: Record<string, Float32Array | Uint8Array> = {};
    pictures.forEach(({ displacements, scalar }, body) => {
      arrays[`${body}/displacements`] = displacements;
      arrays[`${body}/scalar`] = scalar;
    });
    arrays["log"] = thinned(this.log, 3, 2);
    arrays["history"] = thinned(this.history, 8, null);
    this.log = [];
    this.history = [];
    this.replies.message(encodeArrays(header, arrays));
  }

  private recordedFields(tick: Tick): Omit<Tick, "recorded" | "body_time"> {
    const { time, tools, contacts, compute_us, wakeup_us, ticks, missed_deadlines, fault, realtime } = tick;
    return { time, tools, contacts, compute_us, wakeup_us, ticks, missed_deadlines, fault, realtime };
  }

  private recording(tick: Tick, rate: number): object | null {
    if (!tick.recorded) return null;
    const { ticks, error } = tick.recorded;
    return { path: "in this page", ticks, seconds: ticks / rate, size: 0, dropped: 0, error };
  }

  private takeLog(): void {
    const rows = this.program.log(this.scene.data.motion?.body ?? 0);
    for (let at = 0; at < rows.length; at += ROW) {
      this.log.push(rows[at]!, rows[at + 1]!, rows[at + 2]!);
      const time = rows[at + 3]!;
      if (!this.motion || time <= this.bodyTime) continue;
      this.bodyTime = time;
      const [kinetic, strain, coupling, work] = [rows[at + 7]!, rows[at + 8]!, rows[at + 9]!, rows[at + 10]!];
      this.history.push(time, rows[at + 4]!, rows[at + 5]!, rows[at + 6]!, kinetic, strain, kinetic + strain + coupling, work);
    }
  }

  private requireNear(what: string, position: Vec3): void {
    const { centre, size } = this.scene.data;
    if (position.some((x, k) => !(Math.abs(x - centre[k]!) <= REACH * size))) {
      throw new Error(`${what}: the position is far away from the body`);
    }
  }

  private text(message: object): void {
    this.replies.message(JSON.stringify(message));
  }
}

/** What a server does, in the words of its refusal. */
const NEEDS_SERVER: Record<string, string> = {
  mode: "To show a mode",
  replay: "A replay",
  answer: "An exam",
};

/** Rows that a frame may carry, evenly; of a column the largest value of each group is kept. */
function thinned(numbers: number[], columns: number, peaks: number | null): Float32Array {
  const rows = numbers.length / columns;
  const stride = Math.max(Math.ceil(rows / LOG_SENT), 1);
  const reduced: number[] = [];
  for (let row = 0; row < rows; row += stride) {
    const group = Array.from({ length: Math.min(stride, rows - row) }, (_, k) => (row + k) * columns);
    for (let column = 0; column < columns; column++) {
      const values = group.map((at) => numbers[at + column]!);
      reduced.push(column === peaks ? Math.max(...values) : values[0]!);
    }
  }
  return Float32Array.from(reduced);
}

/** v turned by a quaternion w x y z. */
function rotated(v: Vec3, [w, x, y, z]: readonly [number, number, number, number]): Vec3 {
  const t = cross([x, y, z], v).map((c) => 2 * c) as Vec3;
  const u = cross([x, y, z], t);
  return v.map((c, k) => c + w * t[k]! + u[k]!) as Vec3;
}

function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function stamp(date: Date): string {
  return date.toISOString().slice(0, 19).replace(/[-:]/g, "").replace("T", "-");
}
