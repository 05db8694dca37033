// Force, felt stiffness, depth, contact and strain over the picture.

import { shownTool } from "../store";
import type { State, Store } from "../store";
import { contactsOf, deepest, feltStiffness, statedError } from "../tool_contacts";
import { byId, setText, showText } from "./dom";
import { MINUS, inMillimetres, newtonsPerMillimetre, percent, signed, threeDigits, wholePercent } from "./numbers";

/** Linear elasticity leaves out the square of the gradient; beyond about 10 % that shows. */
const LINEAR_STRAIN_MAX = 0.1;
/** Stated error of a force from which a warning is shown. */
const LARGE_ERROR = 0.03;
/** Strain is shown to a tenth of a per cent; a value that rounds to the limit is not beyond it. */
const STRAIN_ROUNDING = 0.0005;

export class Readout {
  private readonly magnitude = byId("force-value");
  private readonly error = byId("force-error");
  private readonly components = [byId("force-x"), byId("force-y"), byId("force-z")];
  private readonly stiffness = byId("stiffness-felt");
  private readonly contactLabel = byId("contact-label");
  private readonly contact = byId("contact-value");
  private readonly slides = byId("contact-slides");
  private readonly pinned = byId("pinned-value");
  private readonly depthLabel = byId("depth-label");
  private readonly depth = byId("depth-value");
  private readonly strain = byId("strain-value");
  private readonly warning = byId("strain-warning");
  private readonly limit = byId("limit-notice");
  private readonly refused = byId("refused-notice");
  private readonly thin = byId("thin-notice");

  constructor(store: Store) {
    store.subscribe(["frame", "pinned", "pressing"], (state) => this.showForces(state));
    store.subscribe(["frame"], (state) => this.showStrain(state));
    store.subscribe(["frame", "pressing"], (state) => this.showContact(state));
  }

  /** The force on the device of the driven tool, and in a second line those of pinned ones. */
  private showForces(state: Readonly<State>): void {
    const { frame, pinned } = state;
    const tool = shownTool(state);
    const driven = tool === null ? undefined : frame?.tools[tool];
    const force = driven?.force ?? [0, 0, 0];
    const magnitude = threeDigits(Math.hypot(...force));
    setText(this.magnitude, magnitude);
    this.magnitude.classList.toggle("long", magnitude.length > 4);
    const error = statedError(contactsOf(frame?.contacts ?? [], tool));
    setText(this.error, error === null ? "" : `±${wholePercent(error)}`);
    force.forEach((component, axis) => setText(this.components[axis]!, signed(component)));
    byId("pinned-line").hidden = pinned.length === 0;
    const others = pinned.map((other) => threeDigits(Math.hypot(...(frame?.tools[other]?.force ?? [0]))));
    setText(this.pinned, others.join(" · "));
    showText(this.refused, driven?.active ? driven.refused : null);
    this.thin.hidden = !driven?.thin;
  }

  /**
   * Of the driven tool: what is told of the contact itself, and until there is one what the pointer wants. Of several
   * places depth and radius are those of the deepest, whose depth is plotted too; all of the tool slides if each does.
   */
  private showContact(state: Readonly<State>): void {
    const { pressing, frame, scene } = state;
    const contacts = contactsOf(frame?.contacts ?? [], shownTool(state));
    const contact = deepest(contacts);
    const stiffness = feltStiffness(contacts, scene?.bodies ?? []);
    setText(this.stiffness, stiffness === null ? "–" : newtonsPerMillimetre(stiffness));
    const slides = contacts.every(({ slipping }) => slipping);
    setText(this.contactLabel, contacts.length > 1 ? `Radius, deepest of ${contacts.length}` : "Contact radius");
    setText(this.contact, contact ? inMillimetres(contact.radius) : "–");
    setText(this.slides, contact ? (slides ? "slides" : "sticks") : "–");
    setText(this.depthLabel, pressing?.grab ? "Pull" : "Depth");
    const depth = contact?.depth ?? pressing?.depth;
    setText(this.depth, depth === undefined ? "–" : inMillimetres(depth).replace("-", MINUS));
  }

  private showStrain({ frame, settings }: Readonly<State>): void {
    const strain = frame?.strain ?? 0;
    setText(this.strain, (100 * strain).toFixed(1));
    const limited = frame?.tools.some((tool) => tool.limited) ?? false;
    const contacts = frame?.contacts ?? [];
    const isNonlinear = contacts.length > 0 && contacts.every(({ error }) => error !== null);
    const held = isNonlinear ? "Held: the material's law ends here" : `Held at ${percent(settings?.strain_limit ?? 0)} strain`;
    showText(this.limit, limited ? held : null);
    const error = Math.max(0, ...contacts.map((contact) => contact.error ?? 0));
    const inexact = isNonlinear ? error >= LARGE_ERROR : strain >= LINEAR_STRAIN_MAX + STRAIN_ROUNDING;
    const warning = isNonlinear
      ? `The force is known to ${wholePercent(error)} here`
      : `${Math.round(100 * strain)} % strain: linear elasticity is accurate up to about 10 %`;
    showText(this.warning, inexact ? warning : null);
  }
}
