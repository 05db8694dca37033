// The line that tells what the mouse does, until it is dismissed.

import { byId } from "./dom";
import { keep, readKept } from "./kept";

const KEY = "hint-dismissed";

export function showHint(): void {
  const hint = byId("hint");
  hint.hidden = readKept(KEY) === "1";
  byId("hint-close").onclick = () => {
    hint.hidden = true;
    keep(KEY, "1");
  };
}
