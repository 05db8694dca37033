// The force in words for screen readers, when it has come to rest or is gone: every change would be too much to hear.

import type { State, Store } from "../store";
import { shownTool } from "../store";
import { contactsOf, deepest, feltStiffness, statedError } from "../tool_contacts";
import { byId, setText } from "./dom";
import { inMillimetres, newtonsPerMillimetre, threeDigits, wholePercent } from "./numbers";

/** A force that stays within this part of itself for so long is at rest. */
const STILL = 0.02;
const STILL_MS = 700;

export class SpokenForce {
  private force = 0;
  private sinceMs = 0;
  private announced = true;

  constructor(store: Store) {
    store.subscribe(["frame"], (state) => this.follow(state));
  }

  private follow(state: Readonly<State>): void {
    const { frame } = state;
    const tool = shownTool(state);
    if (!frame || tool === null) return;
    const force = Math.hypot(...(frame.tools[tool]?.force ?? [0]));
    const nowMs = performance.now();
    if (Math.abs(force - this.force) > STILL * this.force) {
      this.force = force;
      this.sinceMs = nowMs;
      this.announced = false;
    }
    if (this.announced || nowMs - this.sinceMs < STILL_MS) return;
    this.announced = true;
    setText(byId("spoken"), sentence(state, tool, force));
  }
}

function sentence({ frame, scene }: Readonly<State>, tool: number, force: number): string {
  const contacts = contactsOf(frame?.contacts ?? [], tool);
  const contact = deepest(contacts);
  if (!contact) return "Nothing is touched.";
  const stiffness = feltStiffness(contacts, scene?.bodies ?? []);
  const felt = stiffness === null ? "" : `, felt stiffness ${newtonsPerMillimetre(stiffness)} newtons per millimetre`;
  const depth = contact.depth === null ? "" : `, depth ${inMillimetres(contact.depth)} millimetres`;
  const error = statedError(contacts);
  const within = error === null ? "" : ` plus or minus ${wholePercent(error)}`;
  return `Force ${threeDigits(force)} newtons${within}${depth}${felt}.`;
}
