// The scene as it is drawn: bodies where they stand, tools, and the watched node; and what a pointer meets of it.

import * as THREE from "three";

import type { FrameData, FrameMessage, SceneData } from "../net/protocol";
import { grouped } from "../regions";
import { PAINTED, heldStates, isGrowing, isPaintingSupports, touchStates } from "../painting";
import type { State, Store, Stroke, Theme } from "../store";
import { contactsOf } from "../tool_contacts";
import { BodyView } from "./body_view";
import type { Hit, Pick } from "./body_view";
import { cutPlane, facingAxis } from "./cut_plane";
import { ExamPlaces } from "./exam_places";
import { FieldFade } from "./field_fade";
import { NoduleView } from "./nodule_view";
import { SeenVertices } from "./seen_vertices";
import { toolShape } from "./tool_shape";
import type { ToolShape } from "./tool_shape";
import { ToolView } from "./tool_view";
import type { Viewport } from "./viewport";
import { WatchedView } from "./watched_view";

/** Opacity of a body while the nodule in it is placed. */
const SEEN_THROUGH = 0.35;

export class Stage {
  bodies: BodyView[] = [];
  shapes: ToolShape[] = [];
  readonly bounds = new THREE.Box3();
  private tools: ToolView[] = [];
  readonly nodule = new NoduleView();
  private readonly examPlaces = new ExamPlaces();
  private readonly fade = new FieldFade((shares) => {
    for (const body of this.bodies) body.shareField(shares);
    this.viewport.invalidate();
  });
  private stroke: Stroke | null = null;
  private watched: { view: WatchedView; body: number } | null = null;

  constructor(readonly viewport: Viewport, private readonly store: Store) {
    let opened = false;
    store.subscribe(["layers"], ({ layers }) => {
      // A body that is cut open is cut on the side that is looked at.
      if (layers.cutaway && !opened) this.faceCut();
      opened = layers.cutaway;
      this.show();
    });
    store.subscribe(["coloring", "layers"], () => this.color());
    store.subscribe(["computed", "strokes", "exam", "setup"], () => this.mark());
    store.subscribe(["setup"], () => this.showNodule());
    store.subscribe(["theme"], ({ theme }) => this.setTheme(theme));
    store.subscribe(["cut"], () => this.cut());
    // Drawn with the next frame.
    store.subscribe(["shownScale"], ({ shownScale }) => {
      for (const body of this.bodies) body.exaggerate(shownScale);
    });
    viewport.scene.add(this.examPlaces.group, this.nodule.mesh);
    store.subscribe(["exam", "scene"], ({ exam, scene }) => {
      this.examPlaces.show(exam?.places ?? [], scene?.size ?? 0);
      viewport.invalidate();
    });
    store.subscribe(["pinned"], ({ frame }) => {
      if (frame && this.updateTools(frame)) viewport.invalidate();
    });
  }

  setScene({ header, bodies, tools }: SceneData): void {
    const wasSetUp = this.bodies.length > 0 && this.shapes.length === 0;
    this.dispose();
    this.bodies = header.bodies.map((body, i) => new BodyView(i, body, bodies[i]!, header.size));
    this.shapes = header.tools.map((tool, i) => toolShape(tool, tools[i]!));
    this.tools = header.tools.map((tool, i) => new ToolView(header, tool, this.shapes[i]!, this.bodies));
    for (const { group } of [...this.bodies, ...this.tools]) this.viewport.scene.add(group);
    for (const body of this.bodies) body.exaggerate(this.store.get().shownScale);
    this.color();
    this.mark();
    this.showNodule();
    this.setTheme(this.store.get().theme);
    const moving = header.motion && this.bodies[header.motion.body];
    if (header.motion && moving) {
      this.watched = { view: new WatchedView(moving.surface, header.size), body: header.motion.body };
      moving.placed.add(this.watched.view.dot);
    }
    const before = this.bounds.clone();
    this.bounds.makeEmpty();
    for (const body of this.bodies) this.bounds.union(body.bounds);
    // Other tools on the same bodies are no reason to look from elsewhere.
    const points = joined(this.bodies.map((body) => body.restInScene));
    if (this.bodies.length > 0 && !this.bounds.equals(before)) this.viewport.frame(points, header);
    // What is set up fills the picture; what is touched needs room for the tool, and is seen from the same side.
    else if (wasSetUp !== (this.shapes.length === 0)) this.viewport.frame(points, header, this.viewport.towardsViewer());
    if (this.store.get().layers.cutaway) this.faceCut();
    this.show();
  }

  /** Moves to a frame and returns whether the picture changes: bodies at rest are not drawn again and again. */
  update({ header, bodies }: FrameData): boolean {
    const { motion } = header;
    let changed = false;
    this.bodies.forEach((body, i) => {
      const arrays = bodies[i];
      const field = header.fields[i];
      if (!arrays || !field) return;
      const moved = body.update({
        arrays,
        interior: header.interior[i] ?? false,
        signed: field.signed,
        gaps: field.gaps,
        touched: header.contacts.some((contact) => contact.body === i),
        showsMode: motion?.mode != null && this.watched?.body === i,
      });
      changed = moved || changed;
    });
    changed = this.updateTools(header) || changed;
    // A tool would hide the dot.
    const touched = header.tools.some(({ active }) => active);
    this.watched?.view.update(motion && !touched ? motion.watched : null);
    return changed;
  }

  /** The point of a body that is seen along a ray; null beside all, and on the inside that a cut shows. */
  pick(raycaster: THREE.Raycaster): Pick | null {
    return this.firstHit(raycaster)?.pick ?? null;
  }

  /** Whether a ray first meets the inside that a cut shows. */
  showsInside(raycaster: THREE.Raycaster): boolean {
    const hit = this.firstHit(raycaster);
    return hit !== null && hit.pick === null;
  }

  private firstHit(raycaster: THREE.Raycaster): Hit | null {
    const hits = this.bodies.map((body) => body.pick(raycaster)).filter((hit) => hit !== null);
    hits.sort((a, b) => a.distance - b.distance);
    return hits[0] ?? null;
  }

  /** The vertices of all bodies that are seen from here. */
  seenVertices(): SeenVertices {
    const { camera, canvas } = this.viewport;
    camera.updateMatrixWorld();
    const matrix = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse);
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const eye = { position: camera.position.toArray(), matrix: matrix.elements, left, top, width, height };
    return new SeenVertices(this.bodies.map((body) => body.seenSurface()), eye);
  }

  /** Shows a stroke while it is drawn; null when there is none. */
  markStroke(stroke: Stroke | null): void {
    this.stroke = stroke;
    this.mark();
  }

  /** What of the bodies can be touched, and what is painted. */
  private mark(): void {
    const state = this.store.get();
    this.viewport.invalidate();
    if (state.setup?.editing) return this.markSupports(state);
    const shown = this.stroke ? { ...state, strokes: [...state.strokes, this.stroke] } : state;
    this.bodies.forEach((body, i) => body.mark(isGrowing(state) ? touchStates(shown, i) : null));
  }

  /** Where the body that is set up is held: what is painted, or what lies behind the plane. */
  private markSupports(state: Readonly<State>): void {
    const [body, of] = [this.bodies[0], state.setup?.body];
    if (!body || !of?.filled) return;
    if (isPaintingSupports(state)) {
      return body.mark(heldStates(this.stroke ? { ...state, strokes: [...state.strokes, this.stroke] } : state));
    }
    const { axis, above, depth } = of.plane;
    const bound = of.low[axis] + (above ? of.size[axis] - depth : depth);
    body.markWhere(PAINTED, (place) => (above ? place[axis] > bound : place[axis] < bound));
  }

  private showNodule(): void {
    const { setup } = this.store.get();
    const nodule = setup?.editing ? (setup.body?.nodule ?? null) : null;
    this.nodule.show(nodule);
    for (const body of this.bodies) {
      body.show(this.store.get().layers);
      body.setOpacity(nodule ? SEEN_THROUGH : 1);
    }
    this.viewport.invalidate();
  }

  private updateTools(frame: FrameMessage): boolean {
    const { pinned } = this.store.get();
    let changed = false;
    this.tools.forEach((view, i) => {
      const tool = frame.tools[i];
      if (!tool) return;
      const contacts = contactsOf(frame.contacts, i);
      changed = view.update({ tool, contacts, pinned: pinned.includes(i) }) || changed;
    });
    return changed;
  }

  private show(): void {
    const { layers } = this.store.get();
    for (const body of this.bodies) body.show(layers);
    this.cut();
  }

  /** Regions and materials have the same colours in all bodies. */
  private color(): void {
    const { layers, coloring, scene } = this.store.get();
    const shownAsTissue = !layers.colors || scene?.tools.length === 0;
    const grouping = scene && (coloring === "region" || coloring === "material") ? grouped(scene, coloring) : null;
    if (shownAsTissue) this.fade.to({ everywhere: 0, strained: 0 });
    else if (!grouping) this.fade.to({ everywhere: coloring === "field" ? 1 : 0, strained: 1 });
    else {
      this.fade.stop();
      this.bodies.forEach((body, i) => {
        body.colorRegions((grouping.of[i] ?? []).map((group) => new THREE.Color(grouping.groups[group]!.color)));
      });
    }
    this.viewport.invalidate();
  }

  private setTheme(theme: Theme): void {
    for (const body of this.bodies) body.setTheme(theme);
    this.viewport.invalidate();
  }

  private faceCut(): void {
    const axis = facingAxis(this.viewport.towardsViewer());
    this.store.update({ cut: { ...this.store.get().cut, axis } });
  }

  private cut(): void {
    const { axis, share } = this.store.get().cut;
    const plane = cutPlane(this.bounds, axis, share, this.viewport.towardsViewer());
    for (const body of this.bodies) body.cut(plane);
    this.viewport.invalidate();
  }

  private dispose(): void {
    for (const view of [...this.bodies, ...this.tools]) view.dispose();
    // Its dot went with its body.
    this.watched = null;
  }
}

function joined(parts: Float32Array[]): Float32Array {
  const whole = new Float32Array(parts.reduce((length, part) => length + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
