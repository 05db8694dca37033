import { describe, expect, it } from "vitest";

import type { BodyMessage, ContactMessage, Quaternion, Vec3 } from "./net/protocol";
import { contactsOf, deepest, feltStiffness, statedError, totalForce } from "./tool_contacts";

const H = Math.SQRT1_2;
const contact = (over: Partial<ContactMessage>): ContactMessage => ({
  tool: 0,
  body: 0,
  mode: "press",
  point: [0, 0, 0],
  normal: [0, 0, 1],
  force: [0, 0, -1],
  radius: 1e-3,
  depth: 1e-3,
  stiffness: 100,
  slipping: false,
  error: null,
  ...over,
});
const body = (orientation: Quaternion) => ({ orientation }) as BodyMessage;
const UPRIGHT = body([1, 0, 0, 0]);
/** A wall of a groove with a right angle, which stands at 45 degrees to the left or the right, and is pushed by a force. */
const wall = (side: number, force: number, over: Partial<ContactMessage> = {}) =>
  contact({ normal: [side * H, 0, H], force: [-side * H * force, 0, -H * force], ...over });

describe("the stated error of a tool's force", () => {
  it("is the mean over its contacts, weighted by their forces, and none if one states none", () => {
    expect(statedError([])).toBeNull();
    expect(statedError([contact({ error: 0.02 }), contact({ error: null })])).toBeNull();
    const [weak, strong] = [contact({ force: [0, 0, 1], error: 0.05 }), contact({ force: [0, 0, 3], error: 0.01 })];
    expect(statedError([weak, strong])).toBeCloseTo(0.02);
  });
});

describe("the contacts of a tool", () => {
  it("are told apart from those of others, and the deepest from the others", () => {
    const [shallow, deep] = [contact({}), contact({ depth: 2e-3 })];
    expect(contactsOf([shallow, contact({ tool: 1 }), deep], 0)).toEqual([shallow, deep]);
    expect(contactsOf([shallow], null)).toEqual([]);
    expect(deepest([shallow, deep])).toBe(deep);
    expect(deepest([deep, shallow])).toBe(deep);
    expect(deepest([])).toBeNull();
    const held = contact({ depth: null });
    expect(deepest([held, contact({ depth: null })])).toBe(held);
  });

  it("push together with the sum of their forces", () => {
    const whole = totalForce([wall(-1, 2), wall(1, 2)]);
    [0, 0, -2 * Math.SQRT2].forEach((component, axis) => expect(whole[axis]).toBeCloseTo(component, 12));
  });
});

describe("the stiffness that is felt", () => {
  it("is that along the normal, of one contact", () => {
    expect(feltStiffness([wall(1, 1, { stiffness: 70 })], [UPRIGHT])).toBe(70);
    expect(feltStiffness([contact({ stiffness: null })], [UPRIGHT])).toBeNull();
    expect(feltStiffness([], [UPRIGHT])).toBeNull();
  });

  // Springs along the two walls' normals: of each, cos(45 degrees)^2 is felt straight down.
  it("is that of springs along the normals of the places, against the whole force", () => {
    expect(feltStiffness([wall(-1, 1), wall(1, 1)], [UPRIGHT])).toBeCloseTo(100, 9);
    const flat = [contact({ stiffness: 100 }), contact({ stiffness: 50 })];
    expect(feltStiffness(flat, [UPRIGHT])).toBeCloseTo(150, 9);
  });

  it("takes normals from the frame of the body that is touched", () => {
    // A quarter of a turn about y leads the body's x to the scene's -z, and its z to the scene's x.
    const lying = body([H, 0, H, 0]);
    const inBody = contact({ body: 1, normal: [-1, 0, 0] as Vec3 });
    expect(feltStiffness([contact({}), inBody], [UPRIGHT, lying])).toBeCloseTo(200, 9);
  });

  it("is not known where that of a place is not, or where the forces cancel", () => {
    expect(feltStiffness([wall(-1, 1), wall(1, 1, { stiffness: null })], [UPRIGHT])).toBeNull();
    const facing = [contact({ normal: [1, 0, 0], force: [-1, 0, 0] }), contact({ normal: [-1, 0, 0], force: [1, 0, 0] })];
    expect(feltStiffness(facing, [UPRIGHT])).toBeNull();
  });
});
