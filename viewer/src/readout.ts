// Force, depth and strain over the picture.

import { byId, setText } from "./dom";
import { MINUS, signed, threeDigits } from "./numbers";
import type { Vec3 } from "./protocol";

/** Linear elasticity leaves out the square of the gradient; beyond about 10 % that shows. */
const STRAIN_HONEST_MAX = 0.1;
/** Strain is told to a tenth of a per cent: what rounds to the limit is not beyond it. */
const STRAIN_ROUNDING = 0.0005;

export class Readout {
  private readonly magnitude = byId("force-value");
  private readonly components = [byId("force-x"), byId("force-y"), byId("force-z")];
  private readonly depthLabel = byId("depth-label");
  private readonly depth = byId("depth-value");
  private readonly strain = byId("strain-value");
  private readonly warning = byId("strain-warning");
  private readonly hold = byId("hold-notice");

  /** force on the device, N; strain 0.12 is 12 %; heldAt is the strain at which the tool is held back, if it is. */
  update(force: Vec3, strain: number, heldAt: number | null): void {
    setText(this.magnitude, threeDigits(Math.hypot(...force)));
    force.forEach((component, axis) => setText(this.components[axis]!, signed(component)));
    setText(this.strain, (100 * strain).toFixed(1));
    this.hold.hidden = heldAt === null;
    if (heldAt !== null) setText(this.hold, `Held at ${Number((100 * heldAt).toFixed(1))} % strain`);
    this.warning.hidden = strain < STRAIN_HONEST_MAX + STRAIN_ROUNDING;
    if (!this.warning.hidden) {
      const percent = Math.round(100 * strain);
      setText(this.warning, `${percent} % strain: linear elasticity is honest to about 10 %`);
    }
  }

  /** depth in m, null when nothing is pressed. */
  updateDepth(depth: number | null, grab: boolean): void {
    setText(this.depthLabel, grab ? "Pull" : "Depth");
    setText(this.depth, depth === null ? "–" : `${(1000 * depth).toFixed(1).replace("-", MINUS)} mm`);
  }
}
