// What a browser keeps from one visit to the next. One that keeps nothing begins anew each time.

export function readKept(key: string): string | null {
  try {
    return localStorage.getItem(`palpate-${key}`);
  } catch {
    return null;
  }
}

export function keep(key: string, value: string): void {
  try {
    localStorage.setItem(`palpate-${key}`, value);
  } catch {
    // Private windows may refuse.
  }
}
