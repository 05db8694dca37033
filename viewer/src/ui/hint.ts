// The hint line about mouse controls, until it is dismissed or its reader has pressed the body.

import type { Store } from "../store";
import { byId } from "./dom";
import { writeStored, readStored } from "./storage";

const KEY = "hint-dismissed";

export function showHint(store: Store): void {
  const hint = byId("hint");
  const dismiss = () => {
    hint.hidden = true;
    writeStored(KEY, "1");
  };
  hint.hidden = readStored(KEY) === "1";
  byId("hint-close").onclick = dismiss;
  let pressed = false;
  store.subscribe(["pressing"], ({ pressing }) => {
    // While the tool presses, nothing on the page moves.
    if (pressed && !pressing) dismiss();
    pressed = pressing !== null;
  });
}
