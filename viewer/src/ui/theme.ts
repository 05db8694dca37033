// Dark or light: as the system has it, until the person chooses. The colours are those of style.css.

import type { Control } from "../control";
import type { Store, Theme } from "../store";
import { byId } from "./dom";
import { writeStored, readStored } from "./storage";

const KEY = "theme";
const known = new Map<string, string>();

/** The colour that a custom property has in the theme of the moment. */
export function themeColor(property: `--${string}`): string {
  const found = known.get(property);
  if (found !== undefined) return found;
  // A property by itself is shown as it was written; as the colour of an element it is worked out.
  const probe = document.createElement("span");
  probe.style.color = `var(${property})`;
  document.body.append(probe);
  const { color } = getComputedStyle(probe);
  probe.remove();
  known.set(property, color);
  return color;
}

export function followTheme(store: Store, control: Control): void {
  const light = window.matchMedia("(prefers-color-scheme: light)");
  const system = (): Theme => (light.matches ? "light" : "dark");
  const stored = readStored(KEY);
  let chosen = stored === "dark" || stored === "light";
  control.chooseTheme(stored === "dark" || stored === "light" ? stored : system());
  light.addEventListener("change", () => {
    if (!chosen) control.chooseTheme(system());
  });
  byId("theme").onclick = () => {
    chosen = true;
    control.chooseTheme(store.get().theme === "dark" ? "light" : "dark");
    writeStored(KEY, store.get().theme);
  };
  store.subscribe(["theme"], ({ theme }) => {
    document.documentElement.dataset["theme"] = theme;
    known.clear();
    byId("theme").title = theme === "dark" ? "Light colours" : "Dark colours";
    document.querySelector<HTMLMetaElement>('meta[name="theme-color"]')!.content = themeColor("--page");
  });
}
