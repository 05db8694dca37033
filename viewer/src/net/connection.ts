// The websocket: says hello, hands messages on, and tries again when the connection is lost.

import { PROTOCOL_VERSION, decodeBinary, decodeText, isScene } from "./protocol";
import type { ClientMessage, FrameData, SceneData, TextMessage } from "./protocol";

const RETRY_MS = 2000;
/** The server closes with this code when the token is wrong; trying again would not help. */
const CLOSE_BAD_TOKEN = 4401;

export type ConnectionState = "connecting" | "open" | "lost" | "refused";

export interface ConnectionHandlers {
  onState(state: ConnectionState): void;
  onText(message: TextMessage): void;
  onScene(scene: SceneData): void;
  onFrame(frame: FrameData): void;
  /** A message that could not be read. */
  onUnreadable(reason: string): void;
}

export class Connection {
  private socket: WebSocket | null = null;

  constructor(
    private readonly url: string,
    private readonly token: string,
    private readonly handlers: ConnectionHandlers,
  ) {}

  open(): void {
    this.handlers.onState("connecting");
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.send({ type: "hello", token: this.token, version: PROTOCOL_VERSION });
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = (event) => this.closed(event.code);
    this.socket = socket;
  }

  send(message: ClientMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  sendBytes(bytes: ArrayBuffer): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(bytes);
  }

  private receive(data: string | ArrayBuffer): void {
    try {
      if (typeof data === "string") {
        const message = decodeText(data);
        if (message.type === "welcome") this.handlers.onState("open");
        this.handlers.onText(message);
        return;
      }
      const decoded = decodeBinary(data);
      if (isScene(decoded)) this.handlers.onScene(decoded);
      else this.handlers.onFrame(decoded);
    } catch (error) {
      this.handlers.onUnreadable(error instanceof Error ? error.message : String(error));
    }
  }

  private closed(code: number): void {
    this.socket = null;
    if (code === CLOSE_BAD_TOKEN) {
      this.handlers.onState("refused");
      return;
    }
    this.handlers.onState("lost");
    window.setTimeout(() => this.open(), RETRY_MS);
  }
}
