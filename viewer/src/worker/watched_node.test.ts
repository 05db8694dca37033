import { describe, expect, it } from "vitest";

import type { ContactMessage, Vec3 } from "../net/protocol";
import { WatchedNode } from "./watched_node";

// Nodes at x = 0, 1, 2 and 3; those at 0 and 2 are drawn.
const POSITIONS = new Float32Array([0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0]);
const DRAWN = new Uint32Array([0, 2]);

const contactAt = (body: number, point: Vec3): ContactMessage => ({ body, point }) as ContactMessage;

describe("WatchedNode", () => {
  it("stands for a node that is not drawn by the closest drawn one", () => {
    const watched = new WatchedNode(POSITIONS, DRAWN, 3);
    expect([watched.row, watched.node]).toEqual([1, 2]);
  });

  it("is where the body is struck", () => {
    const watched = new WatchedNode(POSITIONS, DRAWN, 3);
    watched.watch([0.4, 1, 0]);
    expect([watched.row, watched.node]).toEqual([0, 0]);
  });

  it("follows contacts of its body that begin or move, and stays when they end", () => {
    const watched = new WatchedNode(POSITIONS, DRAWN, 0);
    expect(watched.follow([contactAt(1, [2, 0, 0])], 0)).toBe(false);
    expect(watched.follow([contactAt(0, [2, 0, 0])], 0)).toBe(true);
    expect(watched.row).toBe(1);
    expect(watched.follow([contactAt(0, [2, 0, 0])], 0)).toBe(false);
    expect(watched.follow([contactAt(0, [0, 0, 0])], 0)).toBe(true);
    expect(watched.follow([], 0)).toBe(false);
    expect(watched.row).toBe(0);
  });
});
