// Force, depth and strain over the picture, and the legend of what is drawn.

import { colorMapCss } from "./color_map";
import { byId, setText } from "./dom";
import type { FrameMessage, Vec3 } from "./protocol";
import type { Shown } from "./body_view";

/** Linear elasticity leaves out the square of the gradient; beyond about 10 % that shows. */
const STRAIN_HONEST_MAX = 0.1;

const MINUS = "\u2212";

function signed(value: number): string {
  const text = Math.abs(value).toFixed(2);
  if (Number(text) === 0) return text;
  return (value < 0 ? MINUS : "+") + text;
}

/** Three digits where the number has them: 0.42, 3.14, 12.5. */
function threeDigits(value: number): string {
  return value.toFixed(value >= 9.995 ? 1 : 2);
}

export class Readout {
  private readonly magnitude = byId("force-value");
  private readonly components = [byId("force-x"), byId("force-y"), byId("force-z")];
  private readonly depthLabel = byId("depth-label");
  private readonly depth = byId("depth-value");
  private readonly strain = byId("strain-value");
  private readonly warning = byId("strain-warning");

  /** force on the device, N; strain 0.12 is 12 %. */
  update(force: Vec3, strain: number): void {
    setText(this.magnitude, threeDigits(Math.hypot(...force)));
    force.forEach((component, axis) => setText(this.components[axis]!, signed(component)));
    setText(this.strain, (100 * strain).toFixed(1));
    this.warning.hidden = strain <= STRAIN_HONEST_MAX;
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

export class Legend {
  private readonly middle = byId("legend-middle");
  private readonly max = byId("legend-max");

  setTissue(color: string): void {
    byId("legend-bar").style.background = colorMapCss(color);
  }

  show(shown: Shown): void {
    byId("legend-field").hidden = !shown.colors;
    byId("legend-supports").hidden = !shown.supports;
    byId("legend-wireframe").hidden = !shown.wireframe;
  }

  update(field: FrameMessage["field"]): void {
    setText(byId("legend-name"), field.name.charAt(0).toUpperCase() + field.name.slice(1));
    setText(byId("legend-unit"), field.unit);
    const digits = field.max >= 10 ? 1 : 2;
    setText(this.middle, (field.max / 2).toFixed(digits));
    setText(this.max, field.max.toFixed(digits));
  }
}
