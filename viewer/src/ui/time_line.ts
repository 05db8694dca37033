// The time line of a replay: where it is, what happened, play and pause, how fast, and whether every bit is as recorded.

import type { Control } from "../control";
import type { ReplayFrame, ReplayScene } from "../net/session_messages";
import { Handle, Way, clock, marksOf, stepped, verdict } from "../replay";
import type { Store } from "../store";
import { byId, create, setText, showText } from "./dom";

const SPEEDS: [label: string, speed: number][] = [
  ["1x", 1],
  ["1/2x", 1 / 2],
  ["1/4x", 1 / 4],
  ["1/10x", 1 / 10],
];
/** The handle stays where it was put while the server has not answered, ms. */
const SEEK_TIMEOUT_MS = 1000;

export class TimeLine {
  private readonly place = byId<HTMLInputElement>("timeline-place");
  private readonly speeds: HTMLButtonElement[];
  private readonly handle = new Handle(SEEK_TIMEOUT_MS);
  private readonly way = new Way();

  constructor(private readonly store: Store, private readonly control: Control) {
    byId("timeline-play").onclick = () => this.toggle();
    byId("timeline-back").onclick = () => this.step(-1);
    byId("timeline-forward").onclick = () => this.step(1);
    this.place.addEventListener("input", () => this.goTo(this.place.valueAsNumber));
    this.speeds = SPEEDS.map(([label, speed]) => create("button", { type: "button", onclick: () => control.replay({ speed }) }, label));
    byId("timeline-speeds").append(...this.speeds);
    // A button that was clicked gives the keys back: the space bar would press it again.
    byId("timeline").addEventListener("click", ({ detail, target }) => {
      if (detail > 0 && target instanceof HTMLButtonElement) target.blur();
    });
    window.addEventListener("keydown", (event) => this.onKey(event));
    store.subscribe(["scene"], ({ scene }) => this.setScene(scene?.replay ?? null));
    store.subscribe(["frame"], ({ frame, scene }) => {
      if (frame?.replay && scene?.replay) this.show(frame.replay, scene.replay);
    });
  }

  private setScene(replay: ReplayScene | null): void {
    for (const id of ["timeline", "replay-note"]) byId(id).hidden = !replay;
    if (!replay) return;
    this.place.max = String(replay.ticks);
    byId("timeline").title = replay.path;
    setText(byId("timeline-total"), clock(replay.ticks, replay.rate));
    showText(byId("timeline-note"), replay.note);
    const marks = marksOf(replay).map(({ place, tick, kind, text }) => {
      const named = { className: `mark mark-${kind}`, title: text, ariaLabel: text };
      const mark = create("button", { type: "button", ...named, onclick: () => this.goTo(tick) });
      mark.style.left = `${100 * place}%`;
      return mark;
    });
    byId("timeline-marks").replaceChildren(...marks);
  }

  private show(replay: ReplayFrame, scene: ReplayScene): void {
    const nowMs = performance.now();
    this.place.valueAsNumber = this.handle.shown(replay.goal, nowMs);
    setText(byId("timeline-time"), clock(replay.tick, scene.rate));
    const play = byId("timeline-play");
    setText(play, replay.playing ? "Pause" : "Play");
    play.title = replay.playing ? "Pause (space)" : "Play (space)";
    this.speeds.forEach((button, i) => button.setAttribute("aria-pressed", String(Math.abs(SPEEDS[i]![1] - replay.speed) < 1e-6)));
    const progress = this.way.seekProgress(replay, nowMs);
    byId("timeline-way").hidden = progress === null;
    if (progress !== null) byId<HTMLProgressElement>("timeline-progress").value = progress;
    const badge = byId("timeline-verdict");
    badge.hidden = progress !== null;
    badge.dataset["state"] = replay.difference ? "bad" : "good";
    badge.title = replay.difference?.text ?? "Each replayed tick is compared with the recorded one, bit by bit.";
    setText(badge, verdict(replay, scene));
  }

  private toggle(): void {
    const replay = this.store.get().frame?.replay;
    if (replay) this.control.replay({ play: !replay.playing });
  }

  /** One tick on or back, at rest. */
  private step(by: number): void {
    const { frame, scene } = this.store.get();
    if (!frame?.replay || !scene?.replay) return;
    const tick = stepped(this.handle.shown(frame.replay.goal, performance.now()), by, scene.replay.ticks);
    this.handle.move(tick, performance.now());
    this.control.replay({ tick, play: false });
  }

  private goTo(tick: number): void {
    this.handle.move(tick, performance.now());
    this.place.valueAsNumber = tick;
    this.control.replay({ tick });
  }

  private onKey(event: KeyboardEvent): void {
    if (!this.store.get().scene?.replay || event.ctrlKey || event.metaKey || event.altKey) return;
    const { target } = event;
    // A button takes the space bar itself, and text takes all keys; the line has arrows of its own.
    if (target instanceof HTMLSelectElement || target instanceof HTMLButtonElement) return;
    if (target instanceof HTMLInputElement && target.type === "text") return;
    if (document.querySelector("dialog[open]")) return;
    const action = { " ": () => this.toggle(), ",": () => this.step(-1), ".": () => this.step(1) }[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }
}
