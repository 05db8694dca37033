// Timing of the 1 kHz loop: what was computed and how late the loop woke, kept apart.

import type { FrameMessage, Percentiles } from "../net/protocol";
import type { Store } from "../store";
import { byId, setText } from "./dom";

/** Numbers that change faster cannot be read. */
const INTERVAL_MS = 250;

export class Statistics {
  /** Frames that were drawn. */
  frames = 0;
  framesPerSecond = 0;
  /** What the page itself took to move what is drawn, for all frames so far, ms. */
  tookMs = 0;
  private readonly compute = cells("stat-compute");
  private readonly wakeup = cells("stat-wakeup");
  private shownMs = 0;
  private countedMs = performance.now();
  private counted = 0;

  constructor(store: Store) {
    store.subscribe(["frame"], ({ frame }) => {
      if (frame) this.show(frame);
    });
  }

  /** Does the work on a frame, and adds what it took. */
  timed<Result>(work: () => Result): Result {
    const startMs = performance.now();
    const result = work();
    this.tookMs += performance.now() - startMs;
    return result;
  }

  private show(frame: FrameMessage): void {
    const nowMs = performance.now();
    this.frames += 1;
    this.counted += 1;
    if (nowMs - this.countedMs >= 1000) {
      this.framesPerSecond = (1000 * this.counted) / (nowMs - this.countedMs);
      this.countedMs = nowMs;
      this.counted = 0;
    }
    if (nowMs - this.shownMs < INTERVAL_MS) return;
    this.shownMs = nowMs;
    fill(this.compute, frame.compute_us);
    fill(this.wakeup, frame.wakeup_us);
    setText(byId("stat-ticks"), frame.ticks.toLocaleString("en"));
    const missed = byId("stat-missed");
    setText(missed, frame.missed_deadlines.toLocaleString("en"));
    missed.classList.toggle("warn", frame.missed_deadlines > 0);
    setText(byId("stat-fps"), this.framesPerSecond.toFixed(0));
    this.showPriority(frame.realtime);
  }

  private showPriority(realtime: boolean): void {
    const badge = byId("realtime");
    badge.hidden = false;
    badge.dataset["state"] = realtime ? "good" : "plain";
    setText(badge, realtime ? "real-time priority" : "no real-time priority");
    badge.title = realtime
      ? "The loop has real-time priority and locked memory."
      : "The system gave the loop no real-time priority: it may wake late when the machine is busy.";
  }
}

function cells(rowId: string): HTMLElement[] {
  return [...byId(rowId).querySelectorAll("td")];
}

function fill(row: HTMLElement[], { p50, p99, p999, max }: Percentiles): void {
  [p50, p99, p999, max].forEach((value, i) => setText(row[i]!, value.toFixed(value < 10 ? 1 : 0)));
}
