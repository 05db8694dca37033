// The surface node of a moving body whose displacement is in the history: where the body was struck or touched last.

import type { ContactMessage, Vec3 } from "../net/protocol";

export class WatchedNode {
  /** Its row among the vertices that are drawn. */
  row: number;
  private touched: Vec3 | null = null;

  constructor(
    /** Of the surface nodes, m, and the ones of them that are drawn. */
    private readonly positions: Float32Array,
    private readonly drawn: Uint32Array,
    node: number,
  ) {
    this.row = this.closestRow(this.position(node));
  }

  /** Its row among the surface nodes. */
  get node(): number {
    return this.drawn[this.row]!;
  }

  /** Watches the drawn node closest to a point in the body's frame. */
  watch(point: Vec3): void {
    this.row = this.closestRow(point);
  }

  /** Watches where a contact begins or has moved to; whether that is so. */
  follow(contacts: ContactMessage[], body: number): boolean {
    const point = contacts.find((contact) => contact.body === body)?.point ?? null;
    const isNew = point !== null && !(this.touched && point.every((x, k) => x === this.touched![k]));
    if (isNew) this.watch(point);
    this.touched = point;
    return isNew;
  }

  private position(node: number): Vec3 {
    return [0, 1, 2].map((k) => this.positions[3 * node + k]!) as Vec3;
  }

  private closestRow(point: Vec3): number {
    let [best, least] = [0, Infinity];
    this.drawn.forEach((node, row) => {
      const away = Math.hypot(...this.position(node).map((x, k) => x - point[k]!));
      if (away < least) [best, least] = [row, away];
    });
    return best;
  }
}
