// What pointer, fingers and keys do, over the page; `?` opens and ends it.

import { KEYS } from "../input/keyboard";
import { byId } from "./dom";

export function toggleHelp(): void {
  const help = byId<HTMLDialogElement>("help");
  if (help.open) help.close();
  else help.showModal();
}

export function fillHelp(): void {
  byId("help-keys").replaceChildren(...KEYS.map(([key, what]) => row(key, what)));
  byId("help-open").onclick = toggleHelp;
  byId("help-close").onclick = toggleHelp;
  // The backdrop belongs to the dialog itself.
  byId("help").onclick = ({ target, currentTarget }) => {
    if (target === currentTarget) toggleHelp();
  };
}

function row(key: string, what: string): HTMLElement {
  const [line, cap, cell] = [document.createElement("div"), document.createElement("dt"), document.createElement("dd")];
  const shown = document.createElement("kbd");
  shown.textContent = key === "Escape" ? "Esc" : key;
  cap.append(shown);
  cell.textContent = what;
  line.append(cap, cell);
  return line;
}
