// What pointer, fingers and keys do, over the page; `?` opens and ends it.

import { KEYS } from "../input/keyboard";
import { byId, create } from "./dom";

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
  const cap = create("kbd", {}, key === "Escape" ? "Esc" : key);
  return create("div", {}, create("dt", {}, cap), create("dd", {}, what));
}
