// The worker of a page without a server: loads program and scene, and wakes as often as a browser lets it.

import type { FromWorker, ToWorker } from "../net/worker_carrier";
import { Program } from "./program";
import { fetchPackage } from "./scene_package";
import { WorkerSession } from "./session";

/** Timers of a browser come after 4 ms at the earliest. */
const WAKE_MS = 1;

let program: Program | null = null;
let session: WorkerSession | null = null;

function post(message: FromWorker, transfer: Transferable[] = []): void {
  self.postMessage(message, { transfer });
}

async function open(programUrl: string, sceneUrl: string): Promise<void> {
  const bytes = fetch(programUrl).then((answer) => {
    if (!answer.ok) throw new Error(`${programUrl}: ${answer.status} ${answer.statusText}`);
    return answer.arrayBuffer();
  });
  const [module, scene] = await Promise.all([bytes, fetchPackage(sceneUrl)]);
  program = await Program.load(module, () => performance.now());
  for (const [name, file] of scene.files) program.provide(name, file);
  scene.files.clear();
  program.open();
  session = new WorkerSession(program, scene, {
    message: (data) => post({ kind: "message", data }, typeof data === "string" ? [] : [data]),
    file: (name, file) => post({ kind: "file", name, bytes: file }, [file]),
  });
  wake();
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
  post({ kind: "failed", id, reason: error instanceof Error ? error.message : String(error) });
}

self.onmessage = (event: MessageEvent<ToWorker>): void => {
  const message = event.data;
  switch (message.kind) {
    case "open":
      open(message.program, message.scene).catch((error: unknown) => fail(null, error));
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
