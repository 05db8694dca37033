// The pointer drags the ball of a nodule, in the plane through its middle that faces the viewer: turn the picture to drag it
// in depth.

import * as THREE from "three";

import type { Stage } from "../scene/stage";
import { editedBody } from "../setup";
import type { Setup } from "../setup";
import type { Store } from "../store";

export class NodulePointer {
  private drag: { pointerId: number; plane: THREE.Plane; offset: THREE.Vector3 } | null = null;

  /** Before the pointers that paint and press, which must not see what is meant for this one. */
  constructor(private readonly stage: Stage, private readonly store: Store, private readonly setup: Setup) {
    const { canvas } = stage.viewport;
    canvas.addEventListener("pointerdown", (event) => this.onDown(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(name, (event) => {
        if (event.pointerId === this.drag?.pointerId) this.finish();
      });
    }
  }

  private onDown(event: PointerEvent): void {
    if (this.drag || event.button !== 0 || !event.isPrimary || !editedBody(this.store.get())?.nodule) return;
    const { viewport, nodule } = this.stage;
    const raycaster = viewport.rayThrough(event.clientX, event.clientY);
    if (!nodule.isMet(raycaster)) return;
    event.stopImmediatePropagation();
    viewport.controls.enabled = false;
    viewport.canvas.setPointerCapture(event.pointerId);
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(viewport.towardsViewer(), nodule.mesh.position);
    const met = raycaster.ray.intersectPlane(plane, new THREE.Vector3()) ?? nodule.mesh.position.clone();
    this.drag = { pointerId: event.pointerId, plane, offset: nodule.mesh.position.clone().sub(met) };
  }

  private onMove(event: PointerEvent): void {
    const { drag, stage } = this;
    if (!drag) return this.hover(event);
    if (event.pointerId !== drag.pointerId) return;
    const { ray } = stage.viewport.rayThrough(event.clientX, event.clientY);
    const met = ray.intersectPlane(drag.plane, new THREE.Vector3());
    if (met) this.setup.moveNodule({ center: met.add(drag.offset).toArray() });
  }

  private hover(event: PointerEvent): void {
    const { viewport, nodule } = this.stage;
    if (!nodule.mesh.visible || event.buttons !== 0) return;
    viewport.canvas.style.cursor = nodule.isMet(viewport.rayThrough(event.clientX, event.clientY)) ? "grab" : "";
  }

  private finish(): void {
    this.drag = null;
    this.stage.viewport.controls.enabled = true;
  }
}
