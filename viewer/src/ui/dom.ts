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

/** Writes a text, or hides its element where there is none. */
export function showText(element: HTMLElement, text: string | null): void {
  element.hidden = text === null;
  setText(element, text ?? "");
}

/** How many CSS pixels a pixel of the design is: more on a very large screen, as the style has it. */
export function designScale(): number {
  return Number.parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;
}

/** Shows a button that stays down as pressed or not. */
export function press(id: string, pressed: boolean): void {
  byId(id).setAttribute("aria-pressed", String(pressed));
}

/** Disables controls, or enables them. */
export function disable(ids: readonly string[], disabled: boolean): void {
  for (const id of ids) byId<HTMLButtonElement>(id).disabled = disabled;
}

/** A new element with its properties, and what is in it. */
export function create<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  properties: Partial<HTMLElementTagNameMap[Tag]> = {},
  ...content: (Node | string)[]
): HTMLElementTagNameMap[Tag] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...content);
  return element;
}

/** Lists named things in a select, unless it lists them already. */
export function list(select: HTMLSelectElement, things: readonly { name: string; title: string; disabled?: boolean }[]): void {
  if ([...select.options].map(({ value }) => value).join() === things.map(({ name }) => name).join()) return;
  const options = things.map(({ name, title, disabled = false }) => Object.assign(new Option(title, name), { disabled }));
  select.replaceChildren(...options);
}
