// An exam: the trial, the answers, and at the end the result.

import type { Control } from "../control";
import type { ExamMessage } from "../net/protocol";
import { inControl } from "../store";
import type { Store } from "../store";
import { byId, create, disable, press, setText } from "./dom";
import { ForceTone } from "./force_tone";

export class ExamPanel {
  private readonly tone = new ForceTone();

  constructor(store: Store, control: Control) {
    byId("exam-mark").onclick = () => control.answer(true);
    byId("exam-none").onclick = () => control.answer(false);
    byId("exam-tone").onclick = () => {
      this.tone.wanted = !this.tone.wanted;
      press("exam-tone", this.tone.wanted);
    };
    store.subscribe(["exam"], ({ exam }) => this.show(exam));
    store.subscribe(["exam", "answering", "role", "connection"], (state) => {
      const able = inControl(state) && !state.answering && state.exam?.result === null;
      disable(["exam-mark", "exam-none"], !able);
    });
    store.subscribe(["frame", "exam"], ({ frame, exam }) => {
      if (exam) this.tone.play(exam.result ? 0 : (frame?.loudness ?? 0));
    });
  }

  private show(exam: ExamMessage | null): void {
    byId("exam").hidden = exam === null;
    document.body.toggleAttribute("data-exam", exam !== null);
    if (!exam) return;
    const { trial, trials, places, result } = exam;
    setText(byId("exam-title"), result ? "The exam is over" : `Trial ${trial} of ${trials}`);
    byId<HTMLProgressElement>("exam-progress").value = result ? 1 : (trial - 1) / trials;
    const where = places.length > 0 ? "under one of the dots" : "somewhere under the surface";
    setText(byId("exam-task"), `Feel for a hard nodule ${where}, and mark it where the tool touches. None: you feel none.`);
    byId("exam-answers").hidden = result !== null;
    byId("exam-result").hidden = result === null;
    if (!result) return;
    byId("exam-lines").replaceChildren(...result.lines.map((line) => create("p", {}, line)));
    byId<HTMLImageElement>("exam-plot").src = result.plot;
  }
}

