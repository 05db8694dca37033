// Commands of the user and messages of the server: each changes the state, and sends a message where it concerns the
// body. Buttons, keys and the pointer all go through here.

import { RateLimit } from "./net/rate_limit";
import type {
  ClientMessage,
  ExamMessage,
  FrameMessage,
  Quaternion,
  Role,
  SceneMessage,
  SettingsMessage,
  ShapeName,
  TextMessage,
  Vec3,
} from "./net/protocol";
import { groupings } from "./regions";
import { NO_LAYERS, shownTool, inControl } from "./store";
import type { Axis, Coloring, Layer, Posture, State, Store, Theme } from "./store";

/** A slider dragged quickly sends no more often than this. */
const SEND_INTERVAL_MS = 40;
/** For so long after the person moved a slider, values from the server do not move it back. */
const LOCAL_VALUE_MS = 400;
/** The scene's own strike waits until the body has been seen at rest. */
const FIRST_STRIKE_MS = 800;
/** What someone does with a body that moves; the scene's own strike would put an end to it. */
const TOUCHES = new Set<ClientMessage["type"]>(["press", "strike", "repeat", "mode"]);
/** More than so many notices hide the picture. */
const NOTICES_MAX = 3;
/** How a tool is held at first: a stylus lies on its side, the others stand upright. */
const LYING: Posture = { tilt: 90, turn: 0 };
const UPRIGHT: Posture = { tilt: 0, turn: 0 };
export const TILT_MAX = 90;
/** The field in the colours of tissue that is strained. */
export const STRAIN = "strain";
/** Why a body from a store, or one of very many elements, is not cut open. */
export const NO_INSIDE =
  "Only the surface of this body is known: stores have no inside, and above 50,000 nodes it is not computed. To cut it open, open its scene or its mesh.";

/** Why a large body is not. */
const TOO_LARGE_TO_CUT = "This body cannot be cut open, because it is drawn with fewer triangles than its surface has.";

export class Control {
  private changedMs = -Infinity;
  private readonly limits = new Map<string, { limit: RateLimit; message: ClientMessage }>();
  private firstStrike: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly store: Store, private readonly sendMessage: (message: ClientMessage) => void) {}

  private send(message: ClientMessage): void {
    if (TOUCHES.has(message.type)) clearTimeout(this.firstStrike);
    this.sendMessage(message);
  }

  // What the server says.

  receiveText(message: TextMessage): void {
    switch (message.type) {
      case "welcome":
        // A long work that ended while the page was away sends no end.
        this.store.update({ version: message.version, models: message.models, status: null });
        return this.receiveRole(message.role);
      case "role":
        return this.receiveRole(message.role);
      case "settings":
        return this.receiveSettings(message);
      case "status":
        return this.store.update({ status: message });
      case "recorded":
        return this.store.update({ recorded: message });
      case "exam":
        return this.receiveExam(message);
      case "computed":
        return this.store.update({ computed: message });
      case "setup":
      case "uploaded":
        return;
      case "error":
        this.store.update({ answering: false });
        return this.notice(message.text);
    }
  }

  /** A new scene: what was touched is let go, and choices that it does not offer are dropped. */
  receiveScene(scene: SceneMessage): void {
    this.release();
    const { field, strike, layers, scene: before, postures, coloring, ranges } = this.store.get();
    const posture = ({ shape }: { shape: ShapeName }, tool: number) =>
      shape === before?.tools[tool]?.shape ? postures[tool]! : firstPosture(shape);
    const offered = scene.bodies[0]?.fields.some(({ name }) => name === field) ?? false;
    this.changedMs = -Infinity;
    // Values that wait to be sent are of the scene before.
    if (before?.name !== scene.name) for (const { limit } of this.limits.values()) limit.cancel();
    clearTimeout(this.firstStrike);
    // Another tool on the same body is no reason to strike it.
    if (before?.name !== scene.name && scene.motion?.strike)
      this.firstStrike = setTimeout(() => this.repeatStrike(), FIRST_STRIKE_MS);
    this.store.update({
      scene,
      settings: {
        type: "settings",
        youngs_modulus: scene.bodies.map((body) => body.youngs_modulus),
        contact_radius: scene.tools.map((tool) => tool.contact_radius),
        friction: scene.tools.map((tool) => tool.friction),
        shape: scene.tools.map((tool) => tool.shape),
        strain_limit: scene.strain_limit,
        time_scale: scene.motion?.time_scale ?? null,
      },
      frame: null,
      answering: false,
      ...(before?.name === scene.name ? {} : { paintTool: null, strokes: [] }),
      postures: scene.tools.map(posture),
      body: scene.motion?.body ?? 0,
      field: offered ? field : null,
      coloring: coloringOf(scene, coloring),
      ranges: before?.name === scene.name ? ranges : {},
      tab: scene.motion ? "motion" : "force",
      strike: strike && scene.motion !== null,
      impulse: scene.motion?.impulse ?? 0,
    });
    // A bare store has no tetrahedra to be shown.
    if (layers.cutaway && !hasInside(scene)) this.toggleLayer("cutaway");
    if (this.store.get().coloring === "strained") this.sendField(STRAIN);
    else if (this.store.get().ranges !== ranges && field !== null) this.sendField(field);
  }

  /** A pinned tool that has left the scene, by a fault or another way, is pinned no more. */
  receiveFrame(frame: FrameMessage): void {
    const { pinned, frame: before } = this.store.get();
    const left = (tool: number) => before?.tools[tool]?.active && !frame.tools[tool]?.active;
    this.store.update({ frame, pinned: pinned.some(left) ? pinned.filter((tool) => !left(tool)) : pinned });
    if (frame.replay) this.receiveReplayedSettings(frame.replay.settings);
  }

  /** What this page looks at, told again after a connection was lost. */
  sendView(): void {
    const { layers, field, coloring } = this.store.get();
    if (layers.cutaway) this.send({ type: "cutaway", on: true });
    if (coloring === "strained") this.sendField(STRAIN);
    else if (field !== null) this.sendField(field);
  }

  notice(text: string): void {
    const { notices } = this.store.get();
    if (!notices.includes(text)) this.store.update({ notices: [...notices, text].slice(-NOTICES_MAX) });
  }

  dismiss(text: string): void {
    this.store.update({ notices: this.store.get().notices.filter((notice) => notice !== text) });
  }

  // What is shown.

  toggleLayer(layer: Layer): void {
    const { layers, scene, exam } = this.store.get();
    if (exam) return;
    const on = !layers[layer];
    if (layer === "cutaway") {
      if (on && !(scene && hasInside(scene))) return this.notice(noCutReason(scene));
      this.send({ type: "cutaway", on });
    }
    this.store.update({ layers: { ...layers, [layer]: on } });
  }

  /** Plots are seen with all controls: where those are hidden, the key shows both. */
  togglePlots(): void {
    const { layers, more, exam } = this.store.get();
    if (more || exam) return this.toggleLayer("plots");
    this.store.update({ more: true, layers: { ...layers, plots: true } });
  }

  cutAcross(axis: Axis): void {
    this.store.update({ cut: { ...this.store.get().cut, axis } });
  }

  cutShare(share: number): void {
    this.store.update({ cut: { ...this.store.get().cut, share } });
  }

  /** A field that is chosen wants to be seen. */
  chooseField(field: string): void {
    this.store.update({ field, coloring: "field", layers: this.coloredLayers() });
    this.sendField(field);
  }

  /** Tissue, with the colours of strain where it is strained. */
  chooseStrained(): void {
    this.store.update({ coloring: "strained", layers: this.coloredLayers() });
    this.sendField(STRAIN);
  }

  /** Colours by region or by material. */
  chooseGrouping(coloring: "region" | "material"): void {
    this.store.update({ coloring, layers: this.coloredLayers() });
  }

  private coloredLayers(): State["layers"] {
    return { ...this.store.get().layers, colors: true };
  }

  /** The next field of the body, then its regions and materials, then tissue. */
  nextField(): void {
    const { scene, body, field, coloring } = this.store.get();
    const fields = scene?.bodies[body]?.fields ?? [];
    if (fields.length === 0) return;
    const groups = groupings(scene);
    if (coloring === "strained") return this.chooseField(fields[0]!.name);
    const at =
      coloring === "field"
        ? Math.max(0, fields.findIndex(({ name }) => name === field))
        : fields.length + groups.indexOf(coloring);
    const next = at + 1;
    if (next < fields.length) this.chooseField(fields[next]!.name);
    else if (next < fields.length + groups.length) this.chooseGrouping(groups[next - fields.length]!);
    else this.chooseStrained();
  }

  /** Ends the colours of a field at a value, in its unit; null lets them follow its largest one. */
  lockRange(field: string, max: number | null): void {
    const others = Object.entries(this.store.get().ranges).filter(([name]) => name !== field);
    this.store.update({ field, ranges: Object.fromEntries(max === null ? others : [...others, [field, max]]) });
    this.sendField(field);
  }

  showMore(more: boolean): void {
    this.store.update({ more });
  }

  chooseTheme(theme: Theme): void {
    this.store.update({ theme });
  }

  chooseBody(body: number): void {
    this.store.update({ body });
  }

  // What the tools do.

  /** Without an orientation the tool keeps the one that it has. */
  press(tool: number, position: Vec3, grab: boolean, orientation: Quaternion | null): void {
    this.send({ type: "press", tool, position, grab, ...(orientation && { orientation }) });
  }

  /** How the driven tool is held, or the one that the next press drives. */
  hold(change: Partial<Posture>): void {
    const state = this.store.get();
    const tool = shownTool(state) ?? 0;
    const { tilt, turn } = { ...state.postures[tool]!, ...change };
    const held = { tilt: Math.min(Math.max(tilt, 0), TILT_MAX), turn: turn - 360 * Math.round(turn / 360) };
    this.store.update({ postures: state.postures.with(tool, held) });
  }

  /** The pointer was let go, or lost: its tool leaves the body, unless it may stay and was to. */
  letGo(mayStay: boolean): void {
    const { pressing, pinNext } = this.store.get();
    if (!pressing) return;
    if (mayStay && pinNext) return this.pin(pressing.tool);
    this.store.update({ pressing: null });
    this.send({ type: "release", tool: pressing.tool });
  }

  /** Leaves the driven tool where it is; with none driven, lets pinned ones go, or says that the next one is to stay. */
  togglePin(): void {
    const state = this.store.get();
    if (!inControl(state) || (state.scene?.tools.length ?? 0) < 2) return;
    if (state.pressing) this.pin(state.pressing.tool);
    else if (state.pinned.length > 0) this.release();
    else this.store.update({ pinNext: !state.pinNext });
  }

  /** Takes all tools out of the scene. */
  release(): void {
    const { pressing, pinned } = this.store.get();
    this.store.update({ pressing: null, pinned: [], pinNext: false });
    if (pressing || pinned.length > 0) this.send({ type: "release" });
  }

  strikeAt(body: number, point: Vec3, inward: Vec3): void {
    const { impulse } = this.store.get();
    this.send({ type: "strike", body, point, impulse: inward.map((share) => share * impulse) as Vec3 });
  }

  repeatStrike(): void {
    if (inControl(this.store.get())) this.send({ type: "repeat" });
  }

  toggleGrab(): void {
    const state = this.store.get();
    if (inControl(state)) this.store.update({ grab: !state.grab });
  }

  toggleStrike(): void {
    const state = this.store.get();
    if (state.strike || (inControl(state) && state.scene?.motion)) this.store.update({ strike: !state.strike });
  }

  /** The mode that is shown ends at a second click, and at 0. */
  showMode(number: number): void {
    const { frame } = this.store.get();
    const shown = frame?.motion?.mode?.number ?? 0;
    const wanted = number === shown ? 0 : number;
    if (inControl(this.store.get()) && wanted !== shown) this.send({ type: "mode", number: wanted });
  }

  /** The nodule is where the tool touches, or did last; or there is none. */
  answer(found: boolean): void {
    const state = this.store.get();
    if (!inControl(state) || !state.exam || state.exam.result || state.answering) return;
    this.store.update({ answering: true, notices: [] });
    this.send({ type: "answer", found });
  }

  // Settings and long work.

  setStiffness(modulus: number): void {
    const { body } = this.store.get();
    const message: ClientMessage = { type: "set", youngs_modulus: modulus, body };
    this.set(`stiffness ${body}`, message, (now) => ({ youngs_modulus: now.youngs_modulus.with(body, modulus) }));
  }

  /** Of the tool that is driven, or that the next press drives. */
  setContactRadius(contact_radius: number): void {
    const tool = shownTool(this.store.get()) ?? 0;
    const changed = (now: SettingsMessage) => ({ contact_radius: now.contact_radius.with(tool, contact_radius) });
    this.set(`radius ${tool}`, { type: "set", contact_radius, tool }, changed);
  }

  /** Of the tool that is driven, or that the next press drives. */
  setFriction(friction: number): void {
    const tool = shownTool(this.store.get()) ?? 0;
    const changed = (now: SettingsMessage) => ({ friction: now.friction.with(tool, friction) });
    this.set(`friction ${tool}`, { type: "set", friction, tool }, changed);
  }

  /** The strain at which tools are held; 0 never holds them. */
  setStrainLimit(limit: number): void {
    this.set("strain limit", { type: "set", strain_limit: limit }, () => ({ strain_limit: limit }));
  }

  /** Shows a setting as it will be, and sends it, as often as the server takes messages of its kind. */
  private set(kind: string, message: ClientMessage, changed: (now: SettingsMessage) => Partial<SettingsMessage>): void {
    const { settings } = this.store.get();
    if (!settings) return;
    this.changedMs = performance.now();
    this.store.update({ settings: { ...settings, ...changed(settings) } });
    this.sendLimited(kind, message);
  }

  /** Of the tool that the next press drives. */
  chooseShape(name: string): void {
    this.release();
    this.send({ type: "shape", tool: shownTool(this.store.get()) ?? 0, name });
  }

  /** Factor by which displacements are drawn larger. */
  showScaled(shownScale: number): void {
    this.store.update({ shownScale });
  }

  setTimeScale(scale: number): void {
    this.send({ type: "set", time_scale: scale });
  }

  chooseModel(name: string): void {
    this.send({ type: "model", name });
  }

  cancel(): void {
    this.send({ type: "cancel" });
  }

  /** Lets go, clears a fault, and puts all sliders back to what they were at first. */
  reset(): void {
    this.release();
    const { scene } = this.store.get();
    if (!inControl(this.store.get()) || !scene) return;
    // A value that was on its way would come after this, and one that was just chosen would hide the answer.
    for (const { limit } of this.limits.values()) limit.cancel();
    this.changedMs = -Infinity;
    this.store.update({
      postures: scene.tools.map(({ shape }) => firstPosture(shape)),
      impulse: scene.motion?.impulse ?? 0,
      shownScale: 1,
    });
    this.send({ type: "reset" });
  }

  // Recordings and replays.

  /** Lets go and records, or ends the recording. */
  toggleRecord(): void {
    const state = this.store.get();
    if (!inControl(state)) return;
    const on = !state.frame?.recording;
    if (on) this.release();
    this.send({ type: "record", on });
  }

  /** Goes to a tick, plays, pauses, or changes the speed; a line that is dragged sends no more often than a slider. */
  replay(change: { tick?: number; play?: boolean; speed?: number }): void {
    this.sendLimited(`replay ${Object.keys(change).join()}`, { type: "replay", ...change });
  }

  /** A replay carries its settings with every frame; most change nothing. */
  private receiveReplayedSettings(settings: SettingsMessage): void {
    if (JSON.stringify(settings) !== JSON.stringify(this.store.get().settings)) this.store.update({ settings });
  }

  private pin(tool: number): void {
    this.store.update({ pressing: null, pinned: [...this.store.get().pinned, tool], pinNext: false });
  }

  private sendField(name: string): void {
    const max = this.store.get().ranges[name];
    this.send({ type: "field", name, ...(max !== undefined && { max }) });
  }

  private receiveExam(exam: ExamMessage): void {
    // The next trial begins with its scene.
    const { answering } = this.store.get();
    this.store.update({ exam, answering: answering && !exam.result, layers: NO_LAYERS, coloring: "field" });
  }

  private receiveRole(role: Role): void {
    if (role === "watch") this.release();
    this.store.update(role === "watch" ? { role, strike: false } : { role });
  }

  private receiveSettings(settings: SettingsMessage): void {
    const own = performance.now() - this.changedMs < LOCAL_VALUE_MS ? this.store.get().settings : null;
    this.store.update({ settings: own ? { ...own, time_scale: settings.time_scale } : settings });
  }

  /** Sends the newest message under a name, not too often. */
  private sendLimited(name: string, message: ClientMessage): void {
    const waiting = this.limits.get(name) ?? {
      limit: new RateLimit(SEND_INTERVAL_MS, () => this.send(this.limits.get(name)!.message)),
      message,
    };
    waiting.message = message;
    this.limits.set(name, waiting);
    waiting.limit.request();
  }
}

/** What a new scene is coloured by: as the scene before, as far as it offers that. A map that was brought is shown at once. */
function coloringOf(scene: SceneMessage, before: Coloring): Coloring {
  const hasPalpatedField = scene.bodies.some(({ fields }) => fields[0]?.name.startsWith("palpated"));
  if (before === "strained") return hasPalpatedField ? "field" : before;
  if (before === "field") return before;
  return groupings(scene).includes(before) ? before : "field";
}

/** How a tool of a shape is held at first. */
export function firstPosture(shape: ShapeName): Posture {
  return shape === "capsule" ? LYING : UPRIGHT;
}

/** Whether any body can be cut open. */
export function hasInside(scene: SceneMessage): boolean {
  return scene.bodies.some(({ tets, drawn }) => tets > 0 && !drawn);
}

/** Why no body can. */
export function noCutReason(scene: SceneMessage | null): string {
  return scene?.bodies.some(({ drawn }) => drawn) ? TOO_LARGE_TO_CUT : NO_INSIDE;
}
