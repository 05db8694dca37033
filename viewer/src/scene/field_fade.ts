// Colours of a field fade in over the tissue and out again, so that the shape stays recognisable.

import type { FieldShares } from "./field_material";

const DURATION_MS = 350;

export class FieldFade {
  private shares: FieldShares = { everywhere: 0, strained: 1 };
  private from = this.shares;
  private goal = this.shares;
  private startedMs = 0;
  private request = 0;

  constructor(private readonly show: (shares: FieldShares) => void) {}

  /** Goes to shares of the colours; at once where the person wants no motion. */
  to(goal: FieldShares): void {
    this.stop();
    this.goal = goal;
    this.from = this.shares;
    this.startedMs = performance.now();
    this.step(prefersStill() || same(goal, this.shares) ? Infinity : this.startedMs);
  }

  /** Leaves the colours to others. */
  stop(): void {
    cancelAnimationFrame(this.request);
  }

  private step(nowMs: number): void {
    const part = Math.min(Math.max((nowMs - this.startedMs) / DURATION_MS, 0), 1);
    this.shares = mixed(this.from, this.goal, part * part * (3 - 2 * part));
    this.show(this.shares);
    if (part < 1) this.request = requestAnimationFrame((time) => this.step(time));
  }
}

function prefersStill(): boolean {
  return window.matchMedia("(prefers-reduced-motion: reduce)").matches;
}

function same(a: FieldShares, b: FieldShares): boolean {
  return a.everywhere === b.everywhere && a.strained === b.strained;
}

function mixed(a: FieldShares, b: FieldShares, part: number): FieldShares {
  const between = (one: number, other: number) => one + part * (other - one);
  return { everywhere: between(a.everywhere, b.everywhere), strained: between(a.strained, b.strained) };
}
