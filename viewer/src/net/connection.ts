// The websocket: says hello, hands messages on, and tries again when the connection is lost.

import { receive } from "./carrier";
import type { Carrier, ConnectionHandlers } from "./carrier";
import { PROTOCOL_VERSION } from "./protocol";
import type { ClientMessage } from "./protocol";

const RETRY_MS = 2000;
/** The server closes with this code when the token is wrong; trying again would not help. */
const CLOSE_BAD_TOKEN = 4401;

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
    socket.onclose = (event) => this.closed(event.code);
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
