// Setting up a body: files, and choices, which are shown at once and sent to the server.

import { nodesOfMask } from "./net/computed_messages";
import type { ClientMessage, TextMessage } from "./net/protocol";
import { RateLimit } from "./net/rate_limit";
import type { Nodule, SetupBody, SetupChange } from "./net/setup_messages";
import { heldMask, isPaintingSupports } from "./painting";
import { inControl } from "./store";
import type { State, Store } from "./store";
import { Upload, refusal } from "./upload";

/** A slider or a ball dragged quickly sends no more often than this. */
const SEND_INTERVAL_MS = 60;
/**
 * A nodule at first: this share of the shortest side, and so many times as stiff as the body. Samani et al. 2007 found
 * high-grade carcinoma up to 13 times as stiff as the tissue around it.
 */
const NODULE_SHARE = 0.15;
const NODULE_FACTOR = 5;

/** The body that is set up, once it can be changed: filled with tetrahedra, by the page in control. */
export function editedBody(state: Readonly<State>): SetupBody | null {
  const { setup, status } = state;
  const body = setup?.editing ? setup.body : null;
  return body?.filled && inControl(state) && !status?.text ? body : null;
}

export class Setup {
  private upload: Upload | null = null;
  private unsent: SetupChange = {};
  private readonly limit = new RateLimit(SEND_INTERVAL_MS, () => this.sendChoices());

  constructor(
    private readonly store: Store,
    private readonly send: (message: ClientMessage) => void,
    private readonly sendBytes: (bytes: ArrayBuffer) => void,
    private readonly notice: (text: string) => void,
  ) {
    store.subscribe(["connection", "role"], (state) => {
      if (!inControl(state)) this.endUpload();
    });
    // What the server has of the painted supports, where it is not what is painted here.
    store.subscribe(["setup", "scene"], (state) => {
      const { setup, scene, strokes } = state;
      const count = scene?.bodies[0]?.surface_nodes;
      if (!setup?.editing || !setup.body || scene?.tools.length !== 0 || !count) return;
      const { held } = setup.body;
      if (heldMask(strokes, count) !== held) store.update({ strokes: held === null ? [] : [[nodesOfMask(held)]] });
    });
  }

  receive(message: TextMessage): void {
    if (message.type === "setup") this.store.update({ setup: message });
    if (message.type === "error") this.endUpload();
    if (message.type !== "uploaded" || !this.upload) return;
    const { file } = this.upload;
    this.showProgress(message.bytes / file.size, file.name);
    if (this.upload.next(message.bytes)) this.upload = null;
  }

  /** Whether files can be brought now. */
  takesFiles(): boolean {
    const state = this.store.get();
    return inControl(state) && (state.setup?.limit ?? 0) > 0 && !state.exam && !state.status?.text;
  }

  open(files: readonly File[]): void {
    const { setup } = this.store.get();
    if (!setup || !this.takesFiles()) return this.notice("No file can be opened now: wait, or take control first.");
    const [file] = files;
    if (!file) return;
    if (files.length > 1) this.notice(`Only ${file.name} is opened: a body is one file.`);
    const reason = refusal(file, setup);
    if (reason) return this.notice(reason);
    this.showProgress(0, file.name);
    this.upload = new Upload(file, setup.part, this.send, this.sendBytes);
  }

  /** Takes a choice: shown at once, sent soon. */
  choose(change: SetupChange): void {
    const state = this.store.get();
    const body = editedBody(state);
    if (!body || !state.setup) return;
    const tissue = state.setup.tissues.find(({ name }) => name === change.tissue);
    const material = tissue && { youngs_modulus: tissue.youngs_modulus, poissons_ratio: tissue.poissons_ratio };
    this.store.update({ setup: { ...state.setup, body: { ...body, ...change, ...material, saved: null } } });
    this.unsent = { ...this.unsent, ...change };
    this.limit.request();
  }

  chooseSegment(name: string, tissue: string): void {
    const body = editedBody(this.store.get());
    if (body) this.choose({ segments: body.segments.map((segment) => (segment.name === name ? { name, tissue } : segment)) });
  }

  toggleNodule(): void {
    const body = editedBody(this.store.get());
    if (body) this.choose({ nodule: body.nodule ? null : firstNodule(body) });
  }

  moveNodule(change: Partial<Nodule>): void {
    const body = editedBody(this.store.get());
    if (!body?.nodule) return;
    const nodule = { ...body.nodule, ...change };
    const center = nodule.center.map((x, i) => Math.min(Math.max(x, body.low[i]!), body.low[i]! + body.size[i]!));
    this.choose({ nodule: { ...nodule, center: center as Nodule["center"] } });
  }

  touch(): void {
    this.sendChoices();
    this.store.update({ paintTool: null });
    this.send({ type: "touch" });
  }

  edit(): void {
    this.send({ type: "edit" });
  }

  save(): void {
    this.sendChoices();
    this.send({ type: "save" });
  }

  private sendChoices(): void {
    const { unsent } = this;
    this.limit.cancel();
    if (Object.keys(unsent).length === 0) return;
    this.unsent = {};
    this.send({ type: "setup", ...unsent });
  }

  private showProgress(progress: number, name: string): void {
    this.store.update({ status: { type: "status", text: `Sending ${name}`, progress, left_s: null } });
  }

  private endUpload(): void {
    if (!this.upload) return;
    this.upload.end();
    this.upload = null;
    this.store.update({ status: null });
  }
}

/** Why the body cannot be touched yet; null if it can. */
export function hindrance(state: Readonly<State>): string | null {
  const body = editedBody(state);
  if (!body) return "The body is being filled with tetrahedra.";
  if (body.unit === null) return "Choose the unit of length of the file first.";
  if (isPaintingSupports(state) && state.strokes.length === 0) return "Paint where the body is held first.";
  return null;
}

function firstNodule(body: SetupBody): Nodule {
  const center = body.low.map((x, i) => x + body.size[i]! / 2) as Nodule["center"];
  const radius = NODULE_SHARE * Math.min(...body.size);
  return { center, radius, youngs_modulus: NODULE_FACTOR * body.youngs_modulus };
}
