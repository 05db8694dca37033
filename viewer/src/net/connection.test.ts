import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { ConnectionHandlers } from "./carrier";
import { Connection } from "./connection";

class FakeSocket {
  static readonly OPEN = 1;
  static last: FakeSocket;
  static count = 0;
  onclose!: (event: { code: number; reason: string }) => void;
  readyState = 0;
  binaryType = "";

  constructor(readonly url: string) {
    FakeSocket.last = this;
    FakeSocket.count += 1;
  }
}

describe("a connection", () => {
  const states: string[] = [];
  const texts: string[] = [];
  const handlers = {
    onState: (state: string) => states.push(state),
    onText: (message: { text?: string }) => texts.push(message.text ?? ""),
  } as unknown as ConnectionHandlers;

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("WebSocket", FakeSocket);
    vi.stubGlobal("window", globalThis);
    [states.length, texts.length, FakeSocket.count] = [0, 0, 0];
    new Connection("ws://server", "token", handlers).open();
  });

  afterEach(() => {
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("tries again when it is lost, and gives the reason of a server that refuses it", () => {
    FakeSocket.last.onclose({ code: 1006, reason: "" });
    vi.advanceTimersByTime(2000);
    FakeSocket.last.onclose({ code: 1013, reason: "too many viewers" });
    vi.advanceTimersByTime(2000);
    expect(FakeSocket.count).toBe(3);
    expect(texts).toEqual(["The server: too many viewers"]);
    expect(states).toEqual(["connecting", "lost", "connecting", "lost", "connecting"]);
  });

  it("does not try again with a wrong token", () => {
    FakeSocket.last.onclose({ code: 4401, reason: "wrong or missing token" });
    vi.advanceTimersByTime(10_000);
    expect(FakeSocket.count).toBe(1);
    expect(states).toEqual(["connecting", "refused"]);
  });
});
