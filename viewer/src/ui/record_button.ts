// The record button: the status of a recording, and its file when it has ended.

import type { Control } from "../control";
import type { RecordedMessage, RecordingStatus } from "../net/session_messages";
import { inControl } from "../store";
import type { Store } from "../store";
import { byId, disable, press, setText } from "./dom";
import { bytes } from "./numbers";

export class RecordButton {
  constructor(store: Store, control: Control) {
    byId("record").onclick = () => control.toggleRecord();
    byId("recording-stop").onclick = () => control.toggleRecord();
    byId("recorded-close").onclick = () => store.update({ recorded: null });
    store.subscribe(["frame"], ({ frame }) => showStatus(frame?.recording ?? null));
    store.subscribe(["recorded"], ({ recorded }) => showEnd(recorded));
    store.subscribe(["scene", "exam", "role", "connection"], (state) => {
      byId("record").hidden = state.scene?.replay != null || state.exam !== null || state.role !== "control";
      byId("recording-stop").hidden = state.role !== "control";
      disable(["record", "recording-stop"], !inControl(state));
    });
  }
}

function showStatus(status: RecordingStatus | null): void {
  press("record", status !== null);
  byId("recording").hidden = status === null;
  if (!status) return;
  byId("recording").title = status.path;
  setText(byId("recording-length"), `${status.seconds.toFixed(1)} s`);
  setText(byId("recording-size"), bytes(status.size));
  setText(byId("recording-dropped"), droppedTicks(status.dropped));
}

function showEnd(recorded: RecordedMessage | null): void {
  byId("recorded").hidden = recorded === null;
  if (!recorded) return;
  const { seconds, size, dropped, error, reason, path, replay } = recorded;
  const length = `Recorded ${seconds.toFixed(1)} s, ${bytes(size)}${droppedTicks(dropped)}`;
  const ended = reason === null ? `${length}.` : `${length}. It ended, for ${reason}.`;
  setText(byId("recorded-what"), error === null ? ended : `The recording failed: ${error}. ${length}.`);
  byId("recorded").classList.toggle("failed", error !== null);
  setText(byId("recorded-path"), path);
  setText(byId("recorded-replay"), replay);
}

function droppedTicks(dropped: number): string {
  return dropped > 0 ? ` · ${dropped.toLocaleString("en")} tick${dropped === 1 ? "" : "s"} dropped` : "";
}
