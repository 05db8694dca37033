// Everything drawn of the body: solid or cut-away, rest wire frame, supports, and the shadow under it.

import * as THREE from "three";

import { CutPlane } from "./cut_plane";
import { CutawayView } from "./cutaway_view";
import { tissueColor } from "./field_material";
import type { FieldUniforms } from "./field_material";
import type { FrameArrays, FrameData, SceneData, Vec3 } from "./protocol";
import { createGroundShadow } from "./ground_shadow";
import { SolidView } from "./solid_view";
import { SupportsView } from "./supports_view";
import { Surface } from "./surface";
import { WireframeView } from "./wireframe_view";

export interface Shown {
  wireframe: boolean;
  colors: boolean;
  cutaway: boolean;
  supports: boolean;
}

export class BodyView {
  readonly group = new THREE.Group();
  readonly surface: Surface;
  readonly bounds = new THREE.Box3();
  readonly cutPlane: CutPlane;
  private readonly solid: SolidView;
  /** The solid as picking sees it: where a ray leaves the body tells what it has passed. */
  private readonly bothSides: THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial>;
  private readonly wireframe: WireframeView;
  private readonly supports: SupportsView;
  private readonly shadow: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;
  /** Made on first use: a large mesh has many tetrahedra, and most people never cut. */
  private cutaway: CutawayView | null = null;
  private cutawayShown = false;
  private drawn: FrameArrays | null = null;

  constructor(readonly data: SceneData, private readonly uniforms: FieldUniforms) {
    const { header, arrays } = data;
    this.surface = new Surface(arrays);
    this.bounds.setFromArray(this.surface.rest);
    this.cutPlane = new CutPlane(this.bounds);
    this.solid = new SolidView(this.surface, tissueColor(header.name), header.size, uniforms);
    this.bothSides = new THREE.Mesh(this.solid.mesh.geometry, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    this.wireframe = new WireframeView(this.surface);
    this.supports = new SupportsView(arrays, header.size);
    this.shadow = createGroundShadow(this.bounds, header.size);
    this.group.add(this.shadow, this.solid.mesh, this.wireframe.lines, this.supports.markers);
  }

  show(shown: Shown): void {
    this.uniforms.fieldShown.value = shown.colors ? 1 : 0;
    this.wireframe.lines.visible = shown.wireframe;
    this.supports.markers.visible = shown.supports;
    this.cutawayShown = shown.cutaway;
    this.solid.mesh.visible = !shown.cutaway;
    if (shown.cutaway && !this.cutaway) {
      this.cutaway = new CutawayView(this.data.arrays, tissueColor(this.data.header.name), this.uniforms);
      this.group.add(this.cutaway.mesh);
    }
    if (this.cutaway) this.cutaway.mesh.visible = shown.cutaway;
    // What is shown from now on has not seen the frames before.
    this.drawn = null;
    this.applyCutPlane();
  }

  applyCutPlane(): void {
    this.cutaway?.setPlane(this.cutPlane.normal, this.cutPlane.offset);
  }

  /** Moves to a frame and tells whether the picture changes; a frame that belongs to another mesh is left out. */
  update(frame: FrameData): boolean {
    const { displacements, scalar } = frame.arrays;
    const { arrays } = this.data;
    const { interior } = frame.header;
    const expected = interior ? arrays.nodes.length : arrays.surface_nodes.length * 3;
    if (displacements.length !== expected || displacements.length !== 3 * scalar.length) return false;
    if (this.drawn && same(this.drawn.displacements, displacements) && same(this.drawn.scalar, scalar)) return false;
    this.drawn = frame.arrays;
    this.surface.displace(displacements, interior ? arrays.surface_nodes : null);
    // A mode shape is only shown: a tool meets the body at rest.
    if (frame.header.motion?.mode) this.surface.settle();
    else if (frame.header.contacts.length === 0) this.surface.keepAsUntouched();
    this.solid.update(scalar);
    if (this.cutawayShown) this.cutaway?.displaceAll(displacements, scalar, interior ? null : arrays.surface_nodes);
    return true;
  }

  /** The point of the surface that is seen along a ray; null beside the body, and on the inside that a cut shows. */
  pick(raycaster: THREE.Raycaster): Pick | null {
    const cutaway = this.cutawayShown ? this.cutaway : null;
    for (const { faceIndex, face, barycoord, point } of raycaster.intersectObject(this.bothSides, false)) {
      if (faceIndex == null || !face || !barycoord) continue;
      const entering = face.normal.dot(raycaster.ray.direction) < 0;
      const removed = cutaway?.removes(faceIndex) ?? false;
      // A ray that comes out of what is left, and went in where the surface is gone, met a face of the cut between.
      if (!entering && !removed) return null;
      if (!entering || removed) continue;
      const { x, y, z } = barycoord;
      const place = { corners: this.surface.cornersOf(faceIndex), weights: [x, y, z] as Vec3 };
      const untouched = new THREE.Vector3(...this.surface.at(this.surface.untouched, place));
      const normal = new THREE.Vector3(...this.surface.at(this.surface.untouchedNormals, place)).normalize();
      const settled = new THREE.Vector3(...this.surface.at(this.surface.settled, place));
      return { shown: point.clone(), untouched, settled, normal };
    }
    return null;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.solid.dispose();
    this.bothSides.material.dispose();
    this.wireframe.dispose();
    this.supports.dispose();
    this.cutaway?.dispose();
    this.shadow.material.map?.dispose();
    this.shadow.material.dispose();
    this.shadow.geometry.dispose();
  }
}

/** A touched point: where it is seen, while nothing is touched, at rest; and the outward normal while nothing is. */
export interface Pick {
  shown: THREE.Vector3;
  untouched: THREE.Vector3;
  settled: THREE.Vector3;
  normal: THREE.Vector3;
}

function same(a: Float32Array | Uint8Array, b: Float32Array | Uint8Array): boolean {
  return a.length === b.length && a.every((value, i) => value === b[i]);
}
