// The line that tells what the mouse does, until it is dismissed.

import { byId } from "./dom";

const KEY = "palpate-hint-dismissed";

export function showHint(): void {
  const hint = byId("hint");
  hint.hidden = readDismissed();
  byId("hint-close").onclick = () => {
    hint.hidden = true;
    try {
      localStorage.setItem(KEY, "1");
    } catch {
      // A browser that keeps nothing shows the hint again next time.
    }
  };
}

function readDismissed(): boolean {
  try {
    return localStorage.getItem(KEY) === "1";
  } catch {
    return false;
  }
}
