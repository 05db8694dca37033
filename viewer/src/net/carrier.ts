// What carries messages between the page and a running loop: a websocket to a server, or a worker beside the page. The messages
// are the same.

import { decodeBinary, decodeText, isScene } from "./protocol";
import type { ClientMessage, FrameData, SceneData, TextMessage } from "./protocol";

export type ConnectionState = "connecting" | "open" | "lost" | "refused";

export interface ConnectionHandlers {
  onState(state: ConnectionState): void;
  onText(message: TextMessage): void;
  onScene(scene: SceneData): void;
  onFrame(frame: FrameData): void;
  /** A message that could not be read. */
  onUnreadable(reason: string): void;
}

export interface Carrier {
  /** Whether a server is behind it: what needs one is refused by the others. */
  readonly hasServer: boolean;
  open(): void;
  send(message: ClientMessage): void;
  sendBytes(bytes: ArrayBuffer): void;
  /** Forces on the first device, N, at each of its positions (three numbers each), m, from rest and tick by tick. */
  run(positions: Float64Array): Promise<Float64Array>;
}

/** Hands a message on as what it is. */
export function receive(data: string | ArrayBuffer, handlers: ConnectionHandlers): void {
  try {
    if (typeof data === "string") {
      const message = decodeText(data);
      if (message.type === "welcome") handlers.onState("open");
      handlers.onText(message);
      return;
    }
    const decoded = decodeBinary(data);
    if (isScene(decoded)) handlers.onScene(decoded);
    else handlers.onFrame(decoded);
  } catch (error) {
    handlers.onUnreadable(error instanceof Error ? error.message : String(error));
  }
}
