// The time line of a replay: texts of times, positions of marks, and when the progress of a seek is shown.

import type { ReplayEvent, ReplayFrame, ReplayScene } from "./net/session_messages";

/** A way that takes longer is shown, ms. */
export const LONG_SEEK_MS = 300;
/** Marks nearer than this part of the line would cover each other, and are one. */
const MARK_APART = 0.006;

export interface Mark {
  /** Along the line, 0 to 1. */
  place: number;
  tick: number;
  kind: ReplayEvent["kind"];
  text: string;
}

/** Seconds to the millisecond, with minutes where there are any. */
export function clock(ticks: number, rate: number): string {
  const milliseconds = Math.round((1000 * ticks) / rate);
  const minutes = Math.floor(milliseconds / 60_000);
  const seconds = ((milliseconds - 60_000 * minutes) / 1000).toFixed(3);
  return minutes > 0 ? `${minutes}:${seconds.padStart(6, "0")}` : seconds;
}

/** Where a tick, counted from 1, stands on a line from the first to the last. */
export function placeOf(tick: number, ticks: number): number {
  return ticks > 1 ? Math.min(Math.max((tick - 1) / (ticks - 1), 0), 1) : 0;
}

/** A tick so many further on, on the line. */
export function stepped(tick: number, by: number, ticks: number): number {
  return Math.min(Math.max(tick + by, 1), ticks);
}

/** Marks of the events; those that stand together are one, of the gravest kind, with the words of all. */
export function marksOf({ events, ticks, rate }: Pick<ReplayScene, "events" | "ticks" | "rate">): Mark[] {
  const marks: Mark[] = [];
  const gravity = { reset: 0, strike: 1, fault: 2 };
  for (const { tick, kind, text } of events) {
    const place = placeOf(tick, ticks);
    const words = `${clock(tick, rate)} s: ${text}`;
    const last = marks.at(-1);
    if (last && place - last.place < MARK_APART) {
      last.text += `\n${words}`;
      if (gravity[kind] > gravity[last.kind]) last.kind = kind;
    } else marks.push({ place, tick, kind, text: words });
  }
  return marks;
}

/** What is told about the bits: the first difference, or how far all are the same. */
export function verdict({ difference, checked }: Pick<ReplayFrame, "difference" | "checked">, { ticks, rate }: ReplayScene): string {
  if (difference) {
    const of = difference.of === "" ? "" : `${difference.of}, `;
    return `Not as recorded from tick ${difference.tick} (${clock(difference.tick, rate)} s) on: ${of}${difference.quantity}`;
  }
  if (checked >= ticks) return `All ${ticks.toLocaleString("en")} ticks are bit-identical`;
  return `Bit-identical so far, to ${clock(checked, rate)} s`;
}

/** How far the way to a tick is, told once it has taken a while; null where there is nothing to tell. */
export class Way {
  private begunMs: number | null = null;

  seekProgress({ tick, goal }: Pick<ReplayFrame, "tick" | "goal">, nowMs: number): number | null {
    if (tick === goal) {
      this.begunMs = null;
      return null;
    }
    this.begunMs ??= nowMs;
    return nowMs - this.begunMs >= LONG_SEEK_MS ? tick / goal : null;
  }
}

/** What the handle of the line shows: where the person has it, until the server says the same or has had its time. */
export class Handle {
  private wanted: number | null = null;
  private movedMs = 0;

  constructor(private readonly patienceMs: number) {}

  move(tick: number, nowMs: number): void {
    this.wanted = tick;
    this.movedMs = nowMs;
  }

  shown(goal: number, nowMs: number): number {
    if (this.wanted !== null && (goal === this.wanted || nowMs - this.movedMs > this.patienceMs)) this.wanted = null;
    return this.wanted ?? goal;
  }
}
