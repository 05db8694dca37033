// Recordings and replays, as parts of the messages of protocol.ts. Ticks are counted from 1.

/** A recording under way. */
export interface RecordingStatus {
  path: string;
  ticks: number;
  seconds: number;
  /** Bytes. */
  size: number;
  /** Ticks that could not be written. */
  dropped: number;
  /** Why nothing is written any more. */
  error: string | null;
}

/** A recording has ended. */
export interface RecordedMessage extends RecordingStatus {
  type: "recorded";
  /** The command that shows it. */
  replay: string;
  /** Why it has, where nobody asked for it. */
  reason: string | null;
}

export interface ReplayEvent {
  tick: number;
  kind: "strike" | "reset" | "fault";
  text: string;
}

/** A recording that is shown in place of a running loop. */
export interface ReplayScene {
  name: string;
  path: string;
  ticks: number;
  /** Ticks a second. */
  rate: number;
  events: ReplayEvent[];
  /** What there is to say about a recording that is not whole. */
  note: string | null;
}

export interface ReplayFrame {
  /** The tick that is shown, and the one that is on its way. */
  tick: number;
  goal: number;
  playing: boolean;
  /** Recorded seconds shown in a second. */
  speed: number;
  /** So many ticks have been compared with what was recorded. */
  checked: number;
  /** How often the replay began anew from the first tick. */
  restarts: number;
  /** The first; null if so far every bit is the same. */
  difference: { tick: number; of: string; quantity: string; text: string } | null;
}

export type SessionCommand =
  | { type: "record"; on: boolean }
  | { type: "replay"; tick?: number; play?: boolean; speed?: number };
