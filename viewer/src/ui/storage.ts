// Settings in the browser's local storage. Without it every visit starts from the defaults.

export function readStored(key: string): string | null {
  try {
    return localStorage.getItem(`palpate-${key}`);
  } catch {
    return null;
  }
}

export function writeStored(key: string, value: string): void {
  try {
    localStorage.setItem(`palpate-${key}`, value);
  } catch {
    // Private windows may refuse.
  }
}
