// The websocket: says hello, hands messages on, and tries again when the connection is lost.

import { receive } from "./carrier";
import type { Carrier, ConnectionHandlers } from "./carrier";
import { PROTOCOL_VERSION } from "./protocol";
import type { ClientMessage } from "./protocol";

const RETRY_MS = 2000;
/** The server closes with this code when the token is wrong; trying again would not help. */
const CLOSE_BAD_TOKEN = 4401;
/** With these the server refuses the page, and says why: another version, too many messages, one too large, too many pages. */
const CLOSE_REFUSED = new Set([1002, 1008, 1009, 1013]);

export class Connection implements Carrier {
  readonly hasServer = true;
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
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => receive(event.data, this.handlers);
    socket.onclose = (event) => this.closed(event.code, event.reason);
    this.socket = socket;
  }

  send(message: ClientMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  sendBytes(bytes: ArrayBuffer): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(bytes);
  }

  run(): Promise<Float64Array> {
    return Promise.reject(new Error("a page of a server makes no runs: use palpate.Simulation.run, or a page of 'palpate web'"));
  }

  private closed(code: number, reason: string): void {
    this.socket = null;
    if (code === CLOSE_BAD_TOKEN) {
      this.handlers.onState("refused");
      return;
    }
    if (CLOSE_REFUSED.has(code) && reason) receive(JSON.stringify({ type: "error", text: `The server: ${reason}` }), this.handlers);
    this.handlers.onState("lost");
    window.setTimeout(() => this.open(), RETRY_MS);
  }
}
