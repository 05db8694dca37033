// The buttons: what is shown, how the pointer touches, and what is done at once.

import type { Control } from "../control";
import { NO_INSIDE, hasInside, noCutReason } from "../control";
import type { Viewport } from "../scene/viewport";
import { CUT_SHARE, inControl } from "../store";
import type { Axis, Layer, Store } from "../store";
import { byId, disable, press, setText, showText } from "./dom";
import { download, takePicture } from "./screenshot";
import { Slider } from "./slider";
import { readStored, writeStored } from "./storage";

const LAYERS: Layer[] = ["colors", "wireframe", "supports", "cutaway", "plots"];
const AXES: Axis[] = ["x", "y", "z"];
/** In the browser's storage: whether all controls are shown. */
const MORE_KEY = "more";

export class Panel {
  private readonly share: Slider;

  constructor(private readonly store: Store, private readonly control: Control, viewport: Viewport) {
    for (const layer of LAYERS) byId(`show-${layer}`).onclick = () => control.toggleLayer(layer);
    for (const axis of AXES) byId(`cut-${axis}`).onclick = () => control.cutAcross(axis);
    this.share = new Slider({
      id: "cut-share",
      name: "Cut",
      format: (share) => `${Math.round(100 * share)} %`,
      units: { "%": 0.01 },
      usual: "%",
      fallback: () => CUT_SHARE,
      choose: (share) => control.cutShare(share),
      showError: (text) => control.notice(text),
    });
    byId("grab").onclick = () => control.toggleGrab();
    byId("pin").onclick = () => control.togglePin();
    byId("unpin").onclick = () => control.release();
    byId("reset").onclick = () => control.reset();
    byId("fault-reset").onclick = () => control.reset();
    byId("reset-view").onclick = () => viewport.reframe();
    byId("screenshot").onclick = () => void this.saveScreenshot(viewport);
    byId("more").onclick = () => {
      control.showMore(!store.get().more);
      writeStored(MORE_KEY, store.get().more ? "1" : "0");
    };
    control.showMore(readStored(MORE_KEY) === "1");
    followSheet(viewport);
    leaveLists();
    this.follow();
  }

  private follow(): void {
    const { store } = this;
    store.subscribe(["layers"], ({ layers }) => {
      for (const layer of LAYERS) press(`show-${layer}`, layers[layer]);
      byId("cut").hidden = !layers.cutaway;
      byId("plots").hidden = !layers.plots;
    });
    store.subscribe(["more"], ({ more }) => {
      // The style places the panel beside the picture, or as a card over it.
      document.documentElement.dataset["more"] = more ? "open" : "closed";
      byId("more-body").hidden = !more;
      byId("more").setAttribute("aria-expanded", String(more));
      setText(byId("more-text"), more ? "Less" : "More");
    });
    store.subscribe(["cut"], ({ cut }) => {
      for (const axis of AXES) press(`cut-${axis}`, axis === cut.axis);
      this.share.show(cut.share);
    });
    store.subscribe(["grab"], ({ grab }) => press("grab", grab));
    store.subscribe(["pinned", "pinNext"], ({ pinned, pinNext }) => press("pin", pinNext || pinned.length > 0));
    store.subscribe(["role", "connection", "pinned", "pressing"], (state) => {
      const watching = state.role !== "control";
      disable(["reset", "fault-reset", "grab", "pin"], watching);
      const nothing = state.pinned.length === 0 && !state.pressing;
      disable(["unpin"], nothing || !inControl(state));
    });
    store.subscribe(["scene"], ({ scene }) => {
      // A finger sees no hints: pressed all the same, the button says why.
      const able = scene !== null && hasInside(scene);
      byId("show-cutaway").setAttribute("aria-disabled", String(!able));
      byId("show-cutaway").title = able ? "Cut open (x)" : noCutReason(scene);
      const whole = able ? scene.bodies.filter(({ tets }) => tets === 0) : [];
      byId("cut-whole").title = NO_INSIDE;
      const titles = whole.map(({ title }) => title).join(", ");
      showText(byId("cut-whole"), whole.length > 0 ? `From a store, so whole: ${titles}` : null);
      byId("fingers").hidden = (scene?.tools.length ?? 0) <= 1;
    });
  }

  private async saveScreenshot(viewport: Viewport): Promise<void> {
    const picture = await takePicture(viewport);
    if (picture) download(picture, this.store.get().scene?.name ?? "empty");
    else this.control.notice("The browser could not save the picture.");
  }
}

/** On a small screen the controls are a sheet that covers nothing, a part of the picture, or most of it. */
function followSheet(viewport: Viewport): void {
  const [panel, fold, tall] = [byId("panel"), byId("sheet-toggle"), byId("sheet-tall")];
  const show = (state: "folded" | "half" | "tall") => {
    panel.classList.toggle("folded", state === "folded");
    panel.classList.toggle("tall", state === "tall");
    fold.setAttribute("aria-expanded", String(state !== "folded"));
    setText(fold, state === "folded" ? "Show" : "Hide");
    tall.hidden = state === "folded";
    tall.setAttribute("aria-pressed", String(state === "tall"));
    tall.title = state === "tall" ? "Lower sheet" : "Taller sheet";
    viewport.invalidate();
  };
  fold.onclick = () => show(panel.classList.contains("folded") ? "half" : "folded");
  tall.onclick = () => show(panel.classList.contains("tall") ? "half" : "tall");
}

/** A list that was used by a pointer gives the keys back: the next letter would choose from it. */
function leaveLists(): void {
  for (const list of document.querySelectorAll("select")) {
    let byPointer = false;
    list.addEventListener("pointerdown", () => (byPointer = true));
    list.addEventListener("keydown", () => (byPointer = false));
    list.addEventListener("change", () => {
      if (byPointer) list.blur();
    });
  }
}
