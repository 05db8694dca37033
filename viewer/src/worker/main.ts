// The worker of a page without a server: loads program and scene, and wakes as often as a browser lets it.

import type { FromWorker, OpenScene, ToWorker } from "../net/worker_carrier";
import { Program } from "./program";
import { fetchPackage } from "./scene_package";
import { WorkerSession } from "./session";

/** Timers of a browser come after 4 ms at the earliest. */
const WAKE_MS = 1;

let module: Promise<WebAssembly.Module> | null = null;
let program: Program | null = null;
let session: WorkerSession | null = null;
/** How often a scene was asked for. */
let asked = 0;

function post(message: FromWorker, transfer: Transferable[] = []): void {
  self.postMessage(message, { transfer });
}

async function compiled(url: string): Promise<WebAssembly.Module> {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
  return WebAssembly.compile(await answer.arrayBuffer());
}

/** Replaces the running scene by another, once that is loaded, unless yet another was chosen meanwhile. */
async function open({ program: programUrl, url, name, models }: OpenScene): Promise<void> {
  const own = ++asked;
  module ??= compiled(programUrl);
  const [code, scene] = await Promise.all([module, fetchPackage(url)]);
  const next = await Program.load(code, () => performance.now());
  if (own !== asked) return;
  for (const [file, bytes] of scene.files) next.provide(file, bytes);
  scene.files.clear();
  next.open();
  const isFirst = session === null;
  session?.close();
  program = next;
  session = new WorkerSession(program, scene, {
    message: (data) => post({ kind: "message", data }, typeof data === "string" ? [] : [data]),
    file: (file, bytes) => post({ kind: "file", name: file, bytes }, [bytes]),
  }, models);
  post({ kind: "opened", name });
  if (isFirst) wake();
}

function wake(): void {
  try {
    session?.wake(performance.now());
    setTimeout(wake, WAKE_MS);
  } catch (error) {
    fail(null, error);
  }
}

function fail(id: number | null, error: unknown): void {
  post({ kind: "failed", id, reason: reasonOf(error) });
}

function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

function say(message: object): void {
  post({ kind: "message", data: JSON.stringify(message) });
}

/** Opens another scene of the page; one that cannot be had leaves the one that runs. */
async function change(scene: OpenScene): Promise<void> {
  const status = (text: string) => say({ type: "status", text, progress: null, left_s: null });
  status(`Loading ${scene.name}`);
  const own = asked + 1;
  try {
    await open(scene);
  } catch (error) {
    say({ type: "error", text: reasonOf(error) });
  }
  if (own === asked) status("");
}

self.onmessage = (event: MessageEvent<ToWorker>): void => {
  const message = event.data;
  switch (message.kind) {
    case "open":
      if (session) void change(message.scene);
      else open(message.scene).catch((error: unknown) => fail(null, error));
      return;
    case "message":
      session?.handle(message.message);
      return;
    case "run":
      try {
        if (!program || !session) throw new Error("the scene is not open yet");
        const forces = program.run(message.positions);
        post({ kind: "forces", id: message.id, forces }, [forces.buffer]);
      } catch (error) {
        fail(message.id, error);
      }
  }
};
