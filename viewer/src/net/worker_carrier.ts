// A worker that runs the loop itself, as WebAssembly: the page needs no server.

import { receive } from "./carrier";
import type { Carrier, ConnectionHandlers } from "./carrier";
import type { ClientMessage } from "./protocol";

/** What the page asks of the worker, and what comes back. */
export type ToWorker =
  | { kind: "open"; program: string; scene: string }
  | { kind: "message"; message: ClientMessage }
  | { kind: "run"; id: number; positions: Float64Array };
export type FromWorker =
  | { kind: "message"; data: string | ArrayBuffer }
  | { kind: "file"; name: string; bytes: ArrayBuffer }
  | { kind: "forces"; id: number; forces: Float64Array }
  | { kind: "failed"; id: number | null; reason: string };

export class WorkerCarrier implements Carrier {
  readonly hasServer = false;
  private readonly worker: Worker;
  private readonly runs = new Map<number, { resolve: (forces: Float64Array) => void; reject: (reason: Error) => void }>();
  private count = 0;

  constructor(
    private readonly program: string,
    private readonly scene: string,
    private readonly handlers: ConnectionHandlers,
    private readonly onFailure: (reason: string) => void,
  ) {
    this.worker = new Worker(new URL("../worker/main.ts", import.meta.url), { type: "module" });
    this.worker.onmessage = (event: MessageEvent<FromWorker>) => this.receive(event.data);
    this.worker.onerror = (event) => this.onFailure(event.message);
  }

  open(): void {
    this.handlers.onState("connecting");
    this.post({ kind: "open", program: this.program, scene: this.scene });
  }

  send(message: ClientMessage): void {
    this.post({ kind: "message", message });
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
      case "file":
        return offer(message.name, message.bytes);
      case "forces":
        this.runs.get(message.id)?.resolve(message.forces);
        this.runs.delete(message.id);
        return;
      case "failed":
        if (message.id === null) return this.onFailure(message.reason);
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
