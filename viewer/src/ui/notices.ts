// Notices of the page: progress, errors, faults, and the state of the connection.

import type { Control } from "../control";
import type { ConnectionState } from "../net/carrier";
import type { StatusMessage } from "../net/protocol";
import { inControl } from "../store";
import type { Store } from "../store";
import { byId, create, setText } from "./dom";
import { duration } from "./numbers";

const CONNECTION_WORDS: Record<ConnectionState, string> = {
  connecting: "Connecting",
  open: "Connected",
  lost: "Disconnected",
  refused: "Refused",
};

/** A notice leaves by itself after so long; faults stay, and so does a notice under the pointer. */
const NOTICE_MS = 12_000;

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

export function showPageMessage(text: string): void {
  byId("page-message").hidden = false;
  setText(byId("page-message-text"), text);
  for (const part of ["panel", "canvas"]) byId(part).inert = true;
}

/** Keeps all of them as the state has them. */
export function followNotices(store: Store, control: Control): void {
  byId("status-cancel").onclick = () => control.cancel();
  store.subscribe(["connection"], ({ connection }) => showConnection(connection));
  store.subscribe(["version"], ({ version }) => setText(byId("version"), version));
  store.subscribe(["role", "version", "scene"], ({ role, version, scene }) => {
    byId("watching").hidden = version === "" || role !== "watch";
    setText(byId("watching"), scene?.replay ? "replay" : "watching");
  });
  store.subscribe(["status"], ({ status }) => showStatus(status));
  store.subscribe(["status", "role", "connection"], (state) => {
    byId<HTMLButtonElement>("status-cancel").hidden = !inControl(state);
  });
  store.subscribe(["frame"], ({ frame }) => showFault(frame?.fault ?? null));
  const leaving = new Map<string, number>();
  const leave = (text: string) => leaving.set(text, window.setTimeout(() => control.dismiss(text), NOTICE_MS));
  const stay = (text: string) => window.clearTimeout(leaving.get(text));
  store.subscribe(["notices"], ({ notices }) => {
    for (const text of [...leaving.keys()].filter((text) => !notices.includes(text))) {
      stay(text);
      leaving.delete(text);
    }
    for (const text of notices) if (!leaving.has(text)) leave(text);
    byId("notices").replaceChildren(
      ...notices.map((text) => {
        const banner = noticeBanner(text, () => control.dismiss(text));
        banner.onpointerenter = () => stay(text);
        banner.onpointerleave = () => leave(text);
        return banner;
      }),
    );
  });
}

function showStatus(status: StatusMessage | null): void {
  byId("status").hidden = !status?.text;
  if (!status) return;
  setText(byId("status-text"), status.text);
  const progress = byId<HTMLProgressElement>("status-progress");
  // Without a value the bar shows that something goes on, but not how far it is.
  if (status.progress === null) progress.removeAttribute("value");
  else progress.value = status.progress;
  setText(byId("status-left"), status.left_s === null ? "" : `${duration(status.left_s)} left`);
}

function showFault(fault: string | null): void {
  byId("fault").hidden = fault === null;
  if (fault !== null) setText(byId("fault-text"), fault);
}

function noticeBanner(text: string, dismiss: () => void): HTMLElement {
  const close = create("button", { type: "button", className: "close", ariaLabel: "Dismiss this message", onclick: dismiss }, "×");
  return create("div", { className: "banner banner-notice line" }, create("span", {}, text), close);
}
