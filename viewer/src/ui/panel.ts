// The buttons: what is shown, how the pointer touches, and what is done at once.

import type { Control } from "../control";
import { hasInside } from "../control";
import type { Viewport } from "../scene/viewport";
import { inControl } from "../store";
import type { Axis, Layer, Store } from "../store";
import { byId, press, setText } from "./dom";
import { download } from "./screenshot";

const LAYERS: Layer[] = ["colors", "wireframe", "supports", "cutaway", "plots"];
const AXES: Axis[] = ["x", "y", "z"];

export class Panel {
  constructor(private readonly store: Store, private readonly control: Control, viewport: Viewport) {
    for (const layer of LAYERS) byId(`show-${layer}`).onclick = () => control.toggleLayer(layer);
    for (const axis of AXES) byId(`cut-${axis}`).onclick = () => control.cutAcross(axis);
    const share = byId<HTMLInputElement>("cut-share");
    share.oninput = () => control.cutShare(share.valueAsNumber);
    byId("grab").onclick = () => control.toggleGrab();
    byId("pin").onclick = () => control.togglePin();
    byId("unpin").onclick = () => control.release();
    byId("reset").onclick = () => control.reset();
    byId("fault-reset").onclick = () => control.reset();
    byId("reset-view").onclick = () => viewport.reframe();
    byId("screenshot").onclick = () => void this.saveScreenshot(viewport);
    byId("sheet-toggle").onclick = () => toggleSheet();
    this.follow();
  }

  private follow(): void {
    const { store } = this;
    store.subscribe(["layers"], ({ layers }) => {
      for (const layer of LAYERS) press(`show-${layer}`, layers[layer]);
      byId("cut").hidden = !layers.cutaway;
      byId("plots").hidden = !layers.plots;
    });
    store.subscribe(["cut"], ({ cut }) => {
      for (const axis of AXES) press(`cut-${axis}`, axis === cut.axis);
    });
    store.subscribe(["grab"], ({ grab }) => press("grab", grab));
    store.subscribe(["pinned", "pinNext"], ({ pinned, pinNext }) => press("pin", pinNext || pinned.length > 0));
    store.subscribe(["role", "connection", "pinned", "pressing"], (state) => {
      const watching = state.role !== "control";
      for (const id of ["reset", "fault-reset", "grab", "pin"]) byId<HTMLButtonElement>(id).disabled = watching;
      const nothing = state.pinned.length === 0 && !state.pressing;
      byId<HTMLButtonElement>("unpin").disabled = nothing || !inControl(state);
    });
    store.subscribe(["scene"], ({ scene }) => {
      byId<HTMLButtonElement>("show-cutaway").disabled = !scene || !hasInside(scene);
      const several = (scene?.tools.length ?? 0) > 1;
      byId("fingers").hidden = !several;
      byId("hint-pin").hidden = !several;
    });
  }

  private async saveScreenshot(viewport: Viewport): Promise<void> {
    const picture = await viewport.toPng();
    if (picture) download(picture, this.store.get().scene?.name ?? "empty");
    else this.control.notice("The browser could not save the picture.");
  }
}

/** On a small screen the controls are a sheet that can be folded away. */
function toggleSheet(): void {
  const folded = byId("panel").classList.toggle("folded");
  const button = byId("sheet-toggle");
  button.setAttribute("aria-expanded", String(!folded));
  setText(button, folded ? "Show" : "Hide");
}
