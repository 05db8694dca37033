// Force against depth of the press that is shown: one point a frame, from where it began; the next press begins anew.

import type { FrameMessage } from "../net/protocol";
import { contactsOf, deepest, totalForce } from "../tool_contacts";

/** A minute of frames. */
const POINTS_MAX = 3600;

export class PressLog {
  /** mm and N. */
  readonly depth: number[] = [];
  readonly force: number[] = [];
  private tool: number | null = null;

  /** Takes in the whole force of a tool, the driven one or null, and how deep it is where it is deepest. */
  append({ contacts }: FrameMessage, tool: number | null): void {
    const touching = contactsOf(contacts, tool);
    const depth = deepest(touching)?.depth ?? null;
    // What was pressed last stays until something else is.
    if (depth === null) {
      this.tool = null;
      return;
    }
    if (this.tool !== tool) this.clear();
    this.tool = tool;
    if (this.depth.length === POINTS_MAX) {
      this.depth.shift();
      this.force.shift();
    }
    this.depth.push(1000 * depth);
    this.force.push(Math.hypot(...totalForce(touching)));
  }

  clear(): void {
    this.depth.length = this.force.length = 0;
    this.tool = null;
  }

  /** What a plot has to span: from the contact itself to the deepest and the hardest. */
  extent(): { depth: [number, number]; force: number } {
    const fold = (values: number[], pick: (a: number, b: number) => number) => values.reduce((a, b) => pick(a, b), 0);
    return { depth: [fold(this.depth, Math.min), fold(this.depth, Math.max)], force: fold(this.force, Math.max) };
  }
}
