// The brush and the line of a lasso, over the picture.

import type { Place } from "../window_regions";
import { byId } from "./dom";

export class PaintMarks {
  private readonly svg = byId("paint-overlay");
  private readonly circle = byId("paint-brush-ring");
  private readonly line = byId("paint-lasso-line");

  brush(place: Place | null, radius: number): void {
    this.circle.setAttribute("visibility", place ? "visible" : "hidden");
    if (!place) return;
    const [x, y] = this.inside(place);
    this.circle.setAttribute("cx", String(x));
    this.circle.setAttribute("cy", String(y));
    this.circle.setAttribute("r", String(radius));
  }

  lasso(line: readonly Place[]): void {
    this.line.setAttribute("points", line.map((place) => this.inside(place).join()).join(" "));
  }

  private inside([x, y]: Place): Place {
    const { left, top } = this.svg.getBoundingClientRect();
    return [x - left, y - top];
  }
}
