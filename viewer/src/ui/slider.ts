// A slider with a number that can be typed beside it; a double click on the slider leads back to its default.

import { byId } from "./dom";
import { parseQuantity } from "./numbers";

export interface SliderOptions {
  /** Of the range input; its number is `<id>-value`. */
  id: string;
  /** What messages call it. */
  name: string;
  /** The value with its unit, as it is shown. */
  format(value: number): string;
  /** Factors of the units that may be typed; a number alone is in the usual one, or in that which is told. */
  units?: Readonly<Record<string, number>>;
  usual?: string;
  /** Words that may be typed, and their values. */
  words?: Readonly<Record<string, number>>;
  /** Place on the slider of a value, and back; the same number if left out. */
  scale?: { toTrack(value: number): number; fromTrack(place: number): number };
  /** Values that may be typed; the ends of the slider if left out. */
  bounds?(): [low: number, high: number];
  /** What a double click leads back to; null, or left out, where there is nothing to go back to. */
  fallback?(): number | null;
  choose(value: number): void;
  /** Of a number that could not be read. */
  showError(text: string): void;
}

export class Slider {
  readonly input: HTMLInputElement;
  private readonly number: HTMLInputElement;
  private value = 0;
  private text = "";

  constructor(private readonly options: SliderOptions) {
    this.input = byId(options.id);
    this.number = byId(`${options.id}-value`);
    this.input.addEventListener("input", () => options.choose(this.fromTrack(this.input.valueAsNumber)));
    this.input.addEventListener("dblclick", () => this.goBack());
    this.number.addEventListener("focus", () => this.number.select());
    this.number.addEventListener("change", () => this.take());
    this.number.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.number.value = this.text;
      if (event.key === "Enter" || event.key === "Escape") this.number.blur();
    });
  }

  /** The value as it is now; or words in its place, where there is none. */
  show(value: number, words: string | null = null): void {
    const { scale } = this.options;
    this.value = value;
    this.text = words ?? this.options.format(value);
    this.input.valueAsNumber = scale ? scale.toTrack(value) : value;
    // What is being typed stays.
    if (document.activeElement !== this.number) this.number.value = this.text;
    // The longest number fits, and what it stands beside keeps its room.
    this.number.size = Math.max(4, this.text.length);
    const back = this.options.fallback?.() ?? null;
    this.input.title = back === null ? "" : `Double click: back to ${this.options.format(back)}`;
  }

  set disabled(disabled: boolean) {
    this.input.disabled = this.number.disabled = disabled;
  }

  private fromTrack(place: number): number {
    return this.options.scale ? this.options.scale.fromTrack(place) : place;
  }

  private goBack(): void {
    const back = this.options.fallback?.() ?? null;
    if (back !== null && !this.input.disabled) this.options.choose(back);
  }

  /** Takes what was typed; what cannot be read is told, and the value stays. */
  private take(): void {
    const { options } = this;
    const { name, units = {}, usual, words = {} } = options;
    const typed = this.number.value;
    this.number.value = this.text;
    if (typed.trim() === this.text) return;
    const word = words[typed.trim().toLowerCase()];
    if (word !== undefined) return options.choose(word);
    const value = parseQuantity(typed, units, usual ?? unitOf(this.text));
    if (value === null) {
      const known = [...Object.keys(units), ...Object.keys(words)];
      const which = known.length > 0 ? `, with ${known.join(", ")} or nothing behind it` : "";
      return options.showError(`${name}: '${typed}' is not a number${which}`);
    }
    const [low, high] = options.bounds?.() ?? [Number(this.input.min), Number(this.input.max)];
    // Of the wrong sign it is a slip of the pen: the end of the range is not what was meant.
    if (low > 0 && value <= 0) {
      return options.showError(`${name} must be positive: '${typed.trim()}' is not taken, ${this.text} stays`);
    }
    const taken = Math.min(Math.max(value, low), high);
    if (taken !== value) options.showError(`${name} goes from ${options.format(low)} to ${options.format(high)}`);
    if (taken !== this.value) options.choose(taken);
  }
}

/** What stands behind the number. */
function unitOf(text: string): string {
  return text.replace(/^[^a-zµ%°A-Z]*/u, "").trim();
}
