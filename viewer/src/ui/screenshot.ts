// Saves the picture.

export function download(blob: Blob, sceneName: string): void {
  const stamp = new Date().toISOString().slice(0, 19).replaceAll(":", "").replace("T", "-");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `palpate-${sceneName}-${stamp}.png`;
  link.click();
  // The download has read the address by then.
  window.setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
