// The hint line about mouse controls, until it is dismissed.

import { byId } from "./dom";
import { writeStored, readStored } from "./storage";

const KEY = "hint-dismissed";

export function showHint(): void {
  const hint = byId("hint");
  hint.hidden = readStored(KEY) === "1";
  byId("hint-close").onclick = () => {
    hint.hidden = true;
    writeStored(KEY, "1");
  };
}
