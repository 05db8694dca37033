// The address of a page without a server holds what the camera looks at: a copied address opens the same view.

import type { Viewport } from "./scene/viewport";
import type { Store } from "./store";

const NAME = "view";

export class ViewLink {
  constructor(
    private readonly viewport: Viewport,
    store: Store,
  ) {
    let opened = false;
    store.subscribe(["frame"], ({ frame }) => {
      if (!frame || opened) return;
      opened = true;
      this.restore();
      viewport.controls.addEventListener("end", () => this.write());
    });
  }

  private restore(): void {
    const numbers = new URLSearchParams(location.hash.slice(1)).get(NAME)?.split(",").map(Number) ?? [];
    if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return;
    const { camera, controls } = this.viewport;
    camera.position.fromArray(numbers, 0);
    controls.target.fromArray(numbers, 3);
    controls.update();
  }

  private write(): void {
    const { camera, controls } = this.viewport;
    const numbers = [...camera.position.toArray(), ...controls.target.toArray()].map((x) => x.toPrecision(5));
    history.replaceState(null, "", `#${NAME}=${numbers.join(",")}`);
  }
}
