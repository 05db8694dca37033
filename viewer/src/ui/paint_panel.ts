// Which part of the surface can be touched, and what is painted to be computed next.

import { NOT_READY, NOT_TOUCHABLE, PAINTED, READY, WAITING, countStates, isGrowing } from "../painting";
import type { Painting } from "../painting";
import { inControl } from "../store";
import type { State, Store } from "../store";
import { brushSlider } from "./brush_slider";
import { byId, press, setText } from "./dom";
import { duration } from "./numbers";
import type { Slider } from "./slider";

const STATES = { ready: READY, waiting: WAITING, painted: PAINTED, later: NOT_READY, never: NOT_TOUCHABLE } as const;

export class PaintPanel {
  private readonly brush: Slider;

  constructor(store: Store, painting: Painting) {
    this.brush = brushSlider("brush", painting, () => this.brush.show(store.get().brushRadius));
    byId("paint-brush").onclick = () => painting.choose("brush");
    byId("paint-lasso").onclick = () => painting.choose("lasso");
    byId("paint-undo").onclick = () => painting.undo();
    byId("paint-clear").onclick = () => painting.clear();
    byId("paint-compute").onclick = () => painting.compute();
    store.subscribe(["paintTool"], ({ paintTool }) => {
      for (const tool of ["brush", "lasso"]) press(`paint-${tool}`, tool === paintTool);
      byId("brush-field").hidden = paintTool !== "brush";
    });
    store.subscribe(["brushRadius"], ({ brushRadius }) => this.brush.show(brushRadius));
    store.subscribe(["computed", "scene", "strokes", "exam"], (state) => this.show(state));
    store.subscribe(["strokes", "role", "connection"], (state) => {
      const nothing = state.strokes.length === 0 || !inControl(state);
      for (const id of ["undo", "clear", "compute"]) byId<HTMLButtonElement>(`paint-${id}`).disabled = nothing;
      for (const id of ["brush", "lasso"]) byId<HTMLButtonElement>(`paint-${id}`).disabled = !inControl(state);
    });
  }

  private show(state: Readonly<State>): void {
    const growing = isGrowing(state);
    byId("paint").hidden = !growing;
    if (!growing || !state.computed) return;
    const counts = countStates(state);
    for (const [name, rank] of Object.entries(STATES)) {
      setText(byId(`paint-count-${name}`), counts[rank].toLocaleString("en"));
      byId(`paint-state-${name}`).hidden = counts[rank] === 0 && name !== "ready";
    }
    const { bodies } = state.computed;
    const [done, columns] = [bodies.reduce((sum, body) => sum + body.done, 0), bodies.reduce((sum, body) => sum + body.columns, 0)];
    byId<HTMLProgressElement>("paint-progress").value = columns > 0 ? done / columns : 1;
    setText(byId("paint-left"), progressText(state.computed.bodies, done, columns));
  }
}

function progressText(bodies: readonly { left_s: number | null; stopped: string | null }[], done: number, columns: number): string {
  const stopped = bodies.find((body) => body.stopped !== null)?.stopped;
  if (stopped) return `Stopped: ${stopped}`;
  const share = `${Math.floor(100 * (columns > 0 ? done / columns : 1))} % computed`;
  const left = Math.max(...bodies.map((body) => body.left_s ?? -1));
  return left < 0 ? share : `${share}, ${duration(left)} left`;
}
