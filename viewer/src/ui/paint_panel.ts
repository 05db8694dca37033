// Which part of the surface can be touched, and what is painted to be computed next.

import { NOT_READY, NOT_TOUCHABLE, PAINTED, READY, WAITING, countStates, isGrowing } from "../painting";
import type { Painting } from "../painting";
import { inControl } from "../store";
import type { State, Store } from "../store";
import { paintControls } from "./paint_controls";
import { byId, disable, setText } from "./dom";
import { duration } from "./numbers";

const STATES = { ready: READY, waiting: WAITING, painted: PAINTED, later: NOT_READY, never: NOT_TOUCHABLE } as const;

export class PaintPanel {
  constructor(store: Store, painting: Painting) {
    // A size that cannot be read leaves the brush as it is.
    paintControls("paint", "brush", painting, store, () => undefined);
    byId("paint-compute").onclick = () => painting.compute();
    store.subscribe(["paintTool"], ({ paintTool }) => (byId("brush-field").hidden = paintTool !== "brush"));
    store.subscribe(["computed", "scene", "strokes", "exam"], (state) => this.show(state));
    store.subscribe(["strokes", "role", "connection"], (state) => {
      const nothing = state.strokes.length === 0 || !inControl(state);
      disable(["paint-undo", "paint-clear", "paint-compute"], nothing);
      disable(["paint-brush", "paint-lasso"], !inControl(state));
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
