// Files dropped on the page or chosen in a dialog, and the page without a body.

import type { Setup } from "../setup";
import { inControl } from "../store";
import type { Store } from "../store";
import { byId, disable, setText } from "./dom";

export class DropZone {
  private readonly input = byId<HTMLInputElement>("file-input");

  constructor(store: Store, private readonly setup: Setup) {
    for (const id of ["file-choose", "setup-other"]) byId(id).onclick = () => this.input.click();
    this.input.onchange = () => {
      const files = [...(this.input.files ?? [])];
      // The same file may be chosen again.
      this.input.value = "";
      setup.open(files);
    };
    this.listen();
    store.subscribe(["setup"], ({ setup: setupState }) => {
      if (!setupState) return;
      // A dialog knows the last ending only: that of .nii.gz is .gz.
      this.input.accept = setupState.endings.map((ending) => ending.slice(ending.lastIndexOf("."))).join();
      const kinds = setupState.endings.map((ending) => ending.slice(1).toUpperCase()).join(", ");
      setText(byId("empty-kinds"), `${kinds}; up to ${(setupState.limit / 1e6).toFixed(0)} MB`);
    });
    store.subscribe(["setup", "status", "role", "connection"], (state) => {
      const { setup: setupState, status } = state;
      byId("empty").hidden = !setupState?.editing || setupState.body !== null || Boolean(status?.text);
      disable(["file-choose"], !inControl(state));
    });
  }

  /** A file dropped anywhere is for the body; without this the browser would open it in place of the page. */
  private listen(): void {
    const overlay = byId("drop");
    let inside = 0;
    const holdsFiles = ({ dataTransfer }: DragEvent) => dataTransfer?.types.includes("Files") ?? false;
    const show = () => (overlay.hidden = inside === 0 || !this.setup.takesFiles());
    window.addEventListener("dragenter", (event) => {
      if (!holdsFiles(event)) return;
      inside += 1;
      show();
    });
    window.addEventListener("dragleave", (event) => {
      if (!holdsFiles(event)) return;
      inside = Math.max(0, inside - 1);
      show();
    });
    window.addEventListener("dragover", (event) => {
      if (holdsFiles(event)) event.preventDefault();
    });
    window.addEventListener("drop", (event) => {
      if (!holdsFiles(event)) return;
      event.preventDefault();
      inside = 0;
      show();
      this.setup.open([...(event.dataTransfer?.files ?? [])]);
    });
  }
}
