// A file that is sent to the server in parts: each follows the answer to the one before.

import type { ClientMessage } from "./net/protocol";
import type { SetupMessage } from "./net/setup_messages";

/** Why a file cannot be sent; null if it can. */
export function refusal(file: { name: string; size: number }, setup: Readonly<SetupMessage>): string | null {
  const ending = /\.[^.]*$/.exec(file.name)?.[0].toLowerCase() ?? "";
  if (!setup.endings.some((known) => file.name.toLowerCase().endsWith(known))) {
    const scene = ending === ".toml" || ending === ".palpate";
    if (scene) return `${file.name}: scenes and stores are opened where they lie, by palpate run ${file.name}`;
    return `${file.name}: no surface, mesh or segmentation by its ending; the page takes ${setup.endings.join(", ")}`;
  }
  if (file.size === 0) return `${file.name}: the file is empty`;
  if (file.size > setup.limit) {
    return `${file.name} has ${(file.size / 1e6).toFixed(0)} MB: the page takes files up to ${(setup.limit / 1e6).toFixed(0)} MB`;
  }
  return null;
}

export class Upload {
  private ended = false;

  /** Announces the file. */
  constructor(
    readonly file: File,
    private readonly part: number,
    private readonly send: (message: ClientMessage) => void,
    private readonly sendBytes: (bytes: ArrayBuffer) => void,
  ) {
    this.send({ type: "upload", name: file.name, size: file.size });
  }

  /** Sends what follows the bytes that have come. Returns whether all of them have. */
  next(received: number): boolean {
    if (received >= this.file.size) return true;
    void this.file.slice(received, received + this.part).arrayBuffer().then((bytes) => {
      if (!this.ended) this.sendBytes(bytes);
    });
    return false;
  }

  /** Nothing more is sent. */
  end(): void {
    this.ended = true;
  }
}
