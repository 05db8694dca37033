// A worker that runs the loop itself, as WebAssembly: the page needs no server.

import { receive } from "./carrier";
import type { Carrier, ConnectionHandlers } from "./carrier";
import type { Choice, ClientMessage } from "./protocol";

/** A scene for the worker: addresses of program and scene, and the scenes that the page offers. */
export interface OpenScene {
  program: string;
  url: string;
  name: string;
  models: Choice[];
}

/** What the page asks of the worker, and what comes back. */
export type ToWorker =
  | { kind: "open"; scene: OpenScene }
  | { kind: "message"; message: ClientMessage }
  | { kind: "run"; id: number; positions: Float64Array };
export type FromWorker =
  | { kind: "message"; data: string | ArrayBuffer }
  | { kind: "opened"; name: string }
  | { kind: "file"; name: string; bytes: ArrayBuffer }
  | { kind: "forces"; id: number; forces: Float64Array }
  | { kind: "failed"; id: number | null; reason: string };

/** Where the files of a page are. */
export interface Site {
  program: string;
  /** The worker's script; null for the one beside the page's own. */
  worker: string | null;
  /** The scene that opens first, and all to choose from. */
  scene: string;
  models: Choice[];
  sceneUrl: (name: string) => string;
}

export interface SiteListener {
  onOpened(scene: string): void;
  onFailure(reason: string): void;
}

export class WorkerCarrier implements Carrier {
  readonly hasServer = false;
  private readonly worker: Worker;
  private readonly runs = new Map<number, { resolve: (forces: Float64Array) => void; reject: (reason: Error) => void }>();
  private count = 0;

  constructor(
    private readonly site: Site,
    private readonly handlers: ConnectionHandlers,
    private readonly listener: SiteListener,
  ) {
    this.worker = site.worker
      ? new Worker(site.worker, { type: "module" })
      : new Worker(new URL("../worker/main.ts", import.meta.url), { type: "module" });
    this.worker.onmessage = (event: MessageEvent<FromWorker>) => this.receive(event.data);
    this.worker.onerror = (event) => this.listener.onFailure(event.message);
  }

  open(): void {
    this.handlers.onState("connecting");
    this.openScene(this.site.scene);
  }

  private openScene(name: string): void {
    const { program, sceneUrl, models } = this.site;
    this.post({ kind: "open", scene: { program, url: sceneUrl(name), name, models } });
  }

  send(message: ClientMessage): void {
    // The names are those that the site has offered.
    if (message.type === "model") this.openScene(message.name);
    else this.post({ kind: "message", message });
  }

  /** Files go to a server only. */
  sendBytes(): void {}

  run(positions: Float64Array): Promise<Float64Array> {
    const id = this.count++;
    this.post({ kind: "run", id, positions });
    return new Promise((resolve, reject) => this.runs.set(id, { resolve, reject }));
  }

  private post(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private receive(message: FromWorker): void {
    switch (message.kind) {
      case "message":
        return receive(message.data, this.handlers);
      case "opened":
        return this.listener.onOpened(message.name);
      case "file":
        return offer(message.name, message.bytes);
      case "forces":
        this.runs.get(message.id)?.resolve(message.forces);
        this.runs.delete(message.id);
        return;
      case "failed":
        if (message.id === null) return this.listener.onFailure(message.reason);
        this.runs.get(message.id)?.reject(new Error(message.reason));
        this.runs.delete(message.id);
    }
  }
}

/** Has the browser save bytes as a file. */
function offer(name: string, bytes: ArrayBuffer): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([bytes]));
  link.download = name;
  link.click();
  window.setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
