// Totals over the contacts of a tool: in a groove or a fold, or on two bodies, it touches at several.

import * as THREE from "three";

import type { BodyMessage, ContactMessage, Vec3 } from "./net/protocol";

export function contactsOf(contacts: readonly ContactMessage[], tool: number | null): ContactMessage[] {
  return contacts.filter((contact) => contact.tool === tool);
}

/** The one that is pressed in the farthest; the first where all hold on by their patches, which have no depth. */
export function deepest(contacts: readonly ContactMessage[]): ContactMessage | null {
  const depth = (contact: ContactMessage) => contact.depth ?? -Infinity;
  return contacts.reduce<ContactMessage | null>((most, one) => (most && depth(most) >= depth(one) ? most : one), null);
}

/** Relative error that the contacts state of their forces together; null if one of them states none. */
export function statedError(contacts: readonly ContactMessage[]): number | null {
  let [error, whole] = [0, 0];
  for (const one of contacts) {
    if (one.error === null) return null;
    const force = Math.hypot(...one.force);
    error += one.error * force;
    whole += force;
  }
  return whole > 0 ? error / whole : null;
}

/** Of all contacts on what they touch, N, in the frame of the scene. */
export function totalForce(contacts: readonly ContactMessage[]): Vec3 {
  const sum: Vec3 = [0, 0, 0];
  for (const { force } of contacts) force.forEach((component, axis) => (sum[axis]! += component));
  return sum;
}

/**
 * Stiffness that is felt, N/m: of one contact that along its normal, of several that along their whole force; null where
 * it is not known.
 *
 * A tool that goes by d along the unit vector f goes by (n_i . f) d along the normal of place i, which then pushes back
 * with k_i (n_i . f)^2 d along f. That the places lie on one body, and each dents the others, is left out.
 */
export function feltStiffness(contacts: readonly ContactMessage[], bodies: readonly BodyMessage[]): number | null {
  if (contacts.length === 1) return contacts[0]!.stiffness;
  const direction = new THREE.Vector3(...totalForce(contacts)).normalize();
  // What holds itself, as between two walls that face each other, has no direction of its force.
  if (contacts.length === 0 || direction.lengthSq() === 0) return null;
  let whole = 0;
  for (const { stiffness, normal, body } of contacts) {
    const placed = bodies[body];
    if (stiffness === null || !placed) return null;
    const [w, x, y, z] = placed.orientation;
    const inScene = new THREE.Vector3(...normal).applyQuaternion(new THREE.Quaternion(x, y, z, w));
    whole += stiffness * inScene.dot(direction) ** 2;
  }
  return whole;
}
