import { describe, expect, it } from "vitest";

import type { FrameMessage } from "../net/protocol";
import { PressLog } from "./press_log";

const frame = (...contacts: { tool: number; mode: string; depth: number | null; force: number[] }[]) =>
  ({ contacts }) as unknown as FrameMessage;
const press = (tool: number, depth: number, force: number) => ({ tool, mode: "press", depth, force: [0, 0, -force] });

describe("the log of a press", () => {
  it("keeps depth in mm and force in N, of the driven tool alone", () => {
    const log = new PressLog();
    log.append(frame(press(0, 1e-3, 0.25), press(1, 9e-3, 5)), 0);
    log.append(frame(press(1, 9e-3, 5), press(0, 2e-3, 0.5)), 0);
    expect(log.depth).toEqual([1, 2]);
    expect(log.force).toEqual([0.25, 0.5]);
    expect(log.extent()).toEqual({ depth: [0, 2], force: 0.5 });
  });

  it("stays after the tool was lifted, and begins anew with the next press or another tool", () => {
    const log = new PressLog();
    log.append(frame(press(0, 1e-3, 0.25)), 0);
    log.append(frame(), 0);
    expect(log.depth).toEqual([1]);
    log.append(frame(press(0, 3e-3, 1)), 0);
    expect(log.depth).toEqual([3]);
    log.append(frame(press(0, 3e-3, 1), press(1, 4e-3, 2)), 1);
    expect(log.depth).toEqual([4]);
  });

  it("takes the whole force of a tool at several places, and the depth of the deepest", () => {
    const log = new PressLog();
    const wall = (side: number, depth: number) => ({ ...press(0, depth, 0), force: [3 * side, 0, -4] });
    log.append(frame(wall(-1, 1e-3), wall(1, 2e-3), press(1, 9e-3, 5)), 0);
    log.append(frame(wall(1, 3e-3), wall(-1, 1e-3)), 0);
    expect(log.depth).toEqual([2, 3]);
    // What they push across, by 3 N each way, cancels.
    expect(log.force).toEqual([8, 8]);
  });

  it("leaves out what is held rather than pressed", () => {
    const log = new PressLog();
    log.append(frame({ ...press(0, 1e-3, 1), mode: "grab", depth: null }), 0);
    expect(log.depth).toEqual([]);
    expect(log.extent()).toEqual({ depth: [0, 0], force: 0 });
  });

  it("forgets the oldest points of a long press", () => {
    const log = new PressLog();
    for (let i = 0; i < 4000; i++) log.append(frame(press(0, 1e-3 * i, 1)), 0);
    expect(log.depth.length).toBe(3600);
    expect(log.depth[0]).toBeCloseTo(400, 9);
  });
});
