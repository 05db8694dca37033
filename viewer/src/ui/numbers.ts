// Numbers as people read them.

export const MINUS = "\u2212";

/** With its sign, two places: +0.42. */
export function signed(value: number): string {
  const text = Math.abs(value).toFixed(2);
  if (Number(text) === 0) return text;
  return (value < 0 ? MINUS : "+") + text;
}

/** Two or three digits: 0.063, 0.42, 3.14, 12.5; what rounds to nothing is 0.00. */
export function threeDigits(value: number): string {
  if (value >= 0.0005 && value < 0.0995) return value.toFixed(3);
  return value.toFixed(value >= 9.995 ? 1 : 2);
}

/** A size of a file, with its unit. */
export function bytes(value: number): string {
  if (value >= 0.9995e6) return `${(value / 1e6).toPrecision(3)} MB`;
  return `${(value / 1e3).toFixed(value >= 9950 ? 0 : 1)} kB`;
}

/** How long something will still take. */
export function duration(seconds: number): string {
  if (seconds < 90) return `about ${Math.max(1, Math.round(seconds))} s`;
  return `about ${Math.round(seconds / 60)} min`;
}

/** A frequency, with its unit. */
export function hertz(value: number): string {
  return `${value >= 999.5 ? value.toFixed(0) : value.toPrecision(3)} Hz`;
}

/** An impulse, with its unit. */
export function newtonSeconds(value: number): string {
  return value >= 0.9995e-3 ? `${(1e3 * value).toPrecision(3)} mN s` : `${(1e6 * value).toPrecision(3)} µN s`;
}

/** A stiffness, with its unit. */
export function pascals(value: number): string {
  if (value >= 0.9995e6) return `${(value / 1e6).toPrecision(3)} MPa`;
  if (value >= 0.9995e3) return `${(value / 1e3).toPrecision(3)} kPa`;
  return `${value.toPrecision(3)} Pa`;
}

/** A stiffness of a contact in N/m, shown in N/mm. */
export function newtonsPerMillimetre(stiffness: number): string {
  const value = stiffness / 1000;
  return value.toFixed(value >= 9.995 ? 1 : value >= 0.9995 ? 2 : 3);
}

/** A part of one, shown in per cent. */
export function percent(part: number): string {
  return `${Number((100 * part).toFixed(1))} %`;
}

/** An error of a force, in whole per cent: never less than it is. */
export function wholePercent(part: number): string {
  return `${Math.ceil(100 * part - 1e-9)} %`;
}

/** A length in m, in mm, without the unit. */
export function inMillimetres(metres: number): string {
  return (1000 * metres).toFixed(1);
}

/** A length in m, shown in mm. */
export function millimetres(metres: number): string {
  return `${inMillimetres(metres)} mm`;
}

/** A round length in m, in the unit that suits it. */
export function lengthText(metres: number): string {
  const [unit, scale] = metres < 0.9995e-3 ? ["µm", 1e6] : metres >= 0.9995 ? ["m", 1] : ["mm", 1e3];
  return `${Number((scale * metres).toPrecision(3))} ${unit}`;
}

/** Sides of a body in m, told in the unit that suits the longest: 200 × 123.4 × 80 mm. */
export function sizeText(sides: readonly number[]): string {
  const largest = Math.max(...sides);
  const [unit, scale] = largest < 1e-3 ? ["µm", 1e6] : largest > 3 ? ["m", 1] : ["mm", 1e3];
  return `${sides.map((side) => Number((scale * side).toPrecision(4))).join(" × ")} ${unit}`;
}

/** An angle in degrees, with its sign. */
export function degrees(angle: number): string {
  const whole = Math.round(angle);
  return `${whole < 0 ? MINUS : ""}${Math.abs(whole)}°`;
}

const NUMBER = /^\s*([+\-\u2212]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[+-]?\d+)?)\s*(.*?)\s*$/iu;

/**
 * A number that was typed, with one of the units behind it, or with the usual one if there is none; null where it is no
 * such number. A comma is a decimal point.
 */
export function parseQuantity(text: string, units: Readonly<Record<string, number>>, usual: string): number | null {
  const found = NUMBER.exec(text);
  if (!found) return null;
  const [, digits, unit] = found as unknown as [string, string, string];
  const value = Number(digits.replace(MINUS, "-").replace(",", "."));
  const factor = (name: string) => units[name] ?? Object.entries(units).find(([u]) => u.toLowerCase() === name.toLowerCase())?.[1];
  const scale = unit === "" ? (factor(usual) ?? 1) : factor(unit);
  return scale === undefined || !Number.isFinite(value) ? null : scale * value;
}
