// Elements of the page by id; one that is missing is a mistake of ours and stops at once.

export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element '${id}'`);
  return element as T;
}

/** Writes only what differs: the browser lays out again after every write. */
export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** How many CSS pixels a pixel of the design is: more on a very large screen, as the style has it. */
export function designScale(): number {
  return Number.parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
}

/** Shows a button that stays down as pressed or not. */
export function press(id: string, pressed: boolean): void {
  byId(id).setAttribute("aria-pressed", String(pressed));
}
