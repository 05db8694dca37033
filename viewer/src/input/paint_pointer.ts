// The pointer as a brush or a lasso. While something is painted it does not press; beside the body a brush leaves it to the
// camera, and two fingers are always the camera's.

import { isPaintingSupports } from "../painting";
import type { Painting } from "../painting";
import type { SeenVertices } from "../scene/seen_vertices";
import type { Stage } from "../scene/stage";
import type { Store, Stroke } from "../store";
import { withinLasso, withinStroke } from "../window_regions";
import type { Place } from "../window_regions";
import { byCamera } from "./hand_over";

/** What a pointer does from when it goes down. */
interface Drawing {
  down: PointerEvent;
  seen: SeenVertices;
  /** Way of the pointer. */
  line: Place[];
  /** Vertices of each body that the brush has met. */
  met: Set<number>[];
}

/** What is drawn over the picture while the pointer paints. */
export interface PaintOverlay {
  brush(place: Place | null, radius: number): void;
  lasso(line: readonly Place[]): void;
}

export class PaintPointer {
  private drawing: Drawing | null = null;
  private handedOver = false;

  /** Before the pointer that presses, which must not see what is meant for this one. */
  constructor(
    private readonly stage: Stage,
    private readonly store: Store,
    private readonly painting: Painting,
    private readonly overlay: PaintOverlay,
  ) {
    const { canvas } = stage.viewport;
    canvas.addEventListener("pointerdown", (event) => this.onDown(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    canvas.addEventListener("pointerleave", () => overlay.brush(null, 0));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(name, (event) => {
        if (event.pointerId === this.drawing?.down.pointerId) this.finish(name === "pointerup");
      });
    }
    store.subscribe(["paintTool"], ({ paintTool }) => {
      if (!paintTool) this.finish(false);
      canvas.classList.toggle("painting", paintTool !== null);
      overlay.brush(null, 0);
    });
  }

  private onDown(event: PointerEvent): void {
    const { paintTool } = this.store.get();
    if (this.handedOver || !paintTool) return;
    if (this.drawing) {
      if (event.pointerType !== "touch") return event.stopImmediatePropagation();
      const { down, line } = this.drawing;
      this.finish(false);
      this.handedOver = true;
      byCamera(this.stage.viewport.canvas, down, line.at(-1)!);
      this.handedOver = false;
      return;
    }
    if (event.button !== 0 || !event.isPrimary) return;
    const place: Place = [event.clientX, event.clientY];
    const { viewport } = this.stage;
    if (paintTool === "brush" && !this.stage.pick(viewport.rayThrough(...place))) return;
    event.stopImmediatePropagation();
    viewport.controls.enabled = false;
    viewport.canvas.setPointerCapture(event.pointerId);
    const seen = this.stage.seenVertices();
    this.drawing = { down: event, seen, line: [place], met: seen.of.map(() => new Set()) };
    this.onMove(event);
  }

  private onMove(event: PointerEvent): void {
    const { paintTool, brushRadius } = this.store.get();
    if (!paintTool) return;
    const place: Place = [event.clientX, event.clientY];
    if (paintTool === "brush" && event.pointerType !== "touch") this.overlay.brush(place, brushRadius);
    const { drawing } = this;
    if (!drawing || event.pointerId !== drawing.down.pointerId) return;
    const before = drawing.line.at(-1)!;
    drawing.line.push(place);
    if (paintTool === "lasso") return this.overlay.lasso(drawing.line);
    this.overlay.brush(place, brushRadius);
    drawing.seen.where(withinStroke(before, place, brushRadius)).forEach((vertices, body) => {
      for (const vertex of vertices) drawing.met[body]!.add(vertex);
    });
    if (isPaintingSupports(this.store.get())) this.meetTriangle(place, drawing);
    this.stage.markStroke(this.strokeOf(drawing.met));
  }

  /** A support holds the triangle under the pointer, however small the brush is beside it. */
  private meetTriangle(place: Place, drawing: Drawing): void {
    const pick = this.stage.pick(this.stage.viewport.rayThrough(...place));
    for (const vertex of pick?.corners ?? []) drawing.met[pick!.body]!.add(vertex);
  }

  /** Keeps what was drawn, or lets it go. */
  private finish(keep: boolean): void {
    const { drawing } = this;
    if (!drawing) return;
    this.drawing = null;
    const { viewport } = this.stage;
    viewport.controls.enabled = true;
    if (viewport.canvas.hasPointerCapture(drawing.down.pointerId)) {
      viewport.canvas.releasePointerCapture(drawing.down.pointerId);
    }
    this.overlay.lasso([]);
    if (drawing.down.pointerType === "touch") this.overlay.brush(null, 0);
    this.stage.markStroke(null);
    if (!keep) return;
    if (this.store.get().paintTool === "lasso") {
      const within = drawing.seen.where(withinLasso(drawing.line));
      this.painting.add(this.strokeOf(within.map((vertices) => new Set(vertices))));
    } else this.painting.add(this.strokeOf(drawing.met));
  }

  private strokeOf(vertices: readonly ReadonlySet<number>[]): Stroke {
    return vertices.map((of, body) => this.stage.bodies[body]!.nodesOf(of));
  }
}
