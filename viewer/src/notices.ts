// What the page has to say: progress, errors, faults, and the state of the connection.

import type { ConnectionState } from "./connection";
import { byId, setText } from "./dom";
import type { Role, TextMessage } from "./protocol";

const NOTICES_MAX = 3;
const CONNECTION_WORDS: Record<ConnectionState, string> = {
  connecting: "Connecting",
  open: "Connected",
  lost: "Disconnected",
  refused: "Refused",
};

export function showConnection(state: ConnectionState): void {
  const element = byId("connection");
  element.dataset["state"] = state;
  setText(element, CONNECTION_WORDS[state]);
  // It stays while trying again, so that it does not blink.
  if (state !== "connecting") byId("connection-banner").hidden = state !== "lost";
  if (state === "refused") {
    showPageMessage("This address has no valid token: use the address that palpate printed.");
  }
}

export function showRole(role: Role): void {
  byId("watching").hidden = role !== "watch";
}

export function showStatus(status: Extract<TextMessage, { type: "status" }>): void {
  byId("status").hidden = status.text === "";
  setText(byId("status-text"), status.text);
  const progress = byId<HTMLProgressElement>("status-progress");
  // Without a value the bar shows that something goes on, but not how far it is.
  if (status.progress === null) progress.removeAttribute("value");
  else progress.value = status.progress;
  setText(byId("status-left"), status.left_s === null ? "" : `${duration(status.left_s)} left`);
}

export function showFault(fault: string | null): void {
  byId("fault").hidden = fault === null;
  if (fault !== null) setText(byId("fault-text"), fault);
}

export function showNotice(text: string): void {
  const list = byId("notices");
  if ([...list.children].some((notice) => notice.firstChild?.textContent === text)) return;
  const notice = document.createElement("div");
  notice.className = "banner banner-notice";
  const words = document.createElement("span");
  words.textContent = text;
  const close = document.createElement("button");
  close.type = "button";
  close.className = "close";
  close.textContent = "×";
  close.setAttribute("aria-label", "Dismiss this message");
  close.onclick = () => notice.remove();
  notice.append(words, close);
  list.append(notice);
  while (list.children.length > NOTICES_MAX) list.firstElementChild!.remove();
}

export function showPageMessage(text: string): void {
  byId("page-message").hidden = false;
  setText(byId("page-message-text"), text);
  for (const part of ["panel", "canvas"]) byId(part).inert = true;
}

function duration(seconds: number): string {
  if (seconds < 90) return `about ${Math.max(1, Math.round(seconds))} s`;
  return `about ${Math.round(seconds / 60)} min`;
}
