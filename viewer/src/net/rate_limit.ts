// Runs an action at most once per interval, the first time at once and always with the newest state.

export class RateLimit {
  private lastMs = -Infinity;
  private timer: number | null = null;

  constructor(private readonly intervalMs: number, private readonly action: () => void) {}

  request(): void {
    if (this.timer !== null) return;
    const wait = this.lastMs + this.intervalMs - performance.now();
    if (wait <= 0) this.run();
    else this.timer = window.setTimeout(() => this.run(), wait);
  }

  cancel(): void {
    if (this.timer !== null) window.clearTimeout(this.timer);
    this.timer = null;
  }

  private run(): void {
    this.cancel();
    this.lastMs = performance.now();
    this.action();
  }
}
