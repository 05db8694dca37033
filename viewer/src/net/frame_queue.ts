// Frames between their arrival and the picture: each is acknowledged once it was taken in and shown.

import type { FrameData } from "./protocol";

export class FrameQueue {
  private pending: FrameData[] = [];
  private taken: number[] = [];

  constructor(private readonly acknowledge: (frame: number) => void) {}

  push(frame: FrameData): void {
    this.pending.push(frame);
  }

  /** What has arrived since the last call, oldest first. The server still counts on an answer to each. */
  take(): FrameData[] {
    const frames = this.pending.splice(0);
    this.taken.push(...frames.map((frame) => frame.header.frame));
    return frames;
  }

  /** Call when the picture with what was taken is shown. */
  answer(): void {
    for (const frame of this.taken.splice(0)) this.acknowledge(frame);
  }

  /** After the connection was lost nobody waits for an answer. */
  clear(): void {
    this.pending = [];
    this.taken = [];
  }
}
