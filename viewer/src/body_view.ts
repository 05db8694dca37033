// Everything drawn of the body: solid or cut-away, rest wire frame, supports, and the shadow under it.

import * as THREE from "three";

import { CutPlane } from "./cut_plane";
import { CutawayView } from "./cutaway_view";
import { tissueColor } from "./field_material";
import type { FieldUniforms } from "./field_material";
import type { FrameArrays, FrameData, SceneData } from "./protocol";
import { createGroundShadow } from "./ground_shadow";
import { SolidView } from "./solid_view";
import { SupportsView } from "./supports_view";
import { Surface } from "./surface";
import { WireframeView } from "./wireframe_view";

/** Below the first of these displacements, over the size, there is no field to show; above the second all of it. */
const FIELD_FADE_START = 1e-4;
const FIELD_FADE_END = 1e-3;

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
  private readonly wireframe: WireframeView;
  private readonly supports: SupportsView;
  private readonly shadow: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;
  /** Made on first use: a large mesh has many tetrahedra, and most people never cut. */
  private cutaway: CutawayView | null = null;
  private cutawayShown = false;
  private colorsShown = false;
  private fieldStrength = 0;
  private drawn: FrameArrays | null = null;

  constructor(readonly data: SceneData, private readonly uniforms: FieldUniforms) {
    const { header, arrays } = data;
    this.surface = new Surface(arrays);
    this.bounds.setFromArray(this.surface.rest);
    this.cutPlane = new CutPlane(this.bounds);
    this.solid = new SolidView(this.surface, tissueColor(header.name), header.size, uniforms);
    this.wireframe = new WireframeView(this.surface);
    this.supports = new SupportsView(arrays, header.size);
    this.shadow = createGroundShadow(this.bounds, header.size);
    this.group.add(this.shadow, this.solid.mesh, this.wireframe.lines, this.supports.markers);
  }

  show(shown: Shown): void {
    this.colorsShown = shown.colors;
    this.uniforms.fieldShown.value = shown.colors ? this.fieldStrength : 0;
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
    const { arrays, header } = this.data;
    const { interior, field } = frame.header;
    const expected = interior ? arrays.nodes.length : arrays.surface_nodes.length * 3;
    if (displacements.length !== expected) return false;
    if (this.drawn && same(this.drawn.displacements, displacements) && same(this.drawn.scalar, scalar)) return false;
    this.drawn = frame.arrays;
    this.surface.displace(displacements, interior ? arrays.surface_nodes : null);
    this.solid.update(scalar);
    const max = field.unit === "mm" ? field.max / 1000 : field.max;
    this.fieldStrength = THREE.MathUtils.smoothstep(max / header.size, FIELD_FADE_START, FIELD_FADE_END);
    this.uniforms.fieldShown.value = this.colorsShown ? this.fieldStrength : 0;
    if (this.cutawayShown) this.cutaway?.displaceAll(displacements, interior ? null : arrays.surface_nodes, max);
    return true;
  }

  /** First visible point of the drawn surface along a ray. */
  pick(raycaster: THREE.Raycaster): Pick | null {
    for (const hit of raycaster.intersectObject(this.solid.mesh, false)) {
      if (hit.faceIndex === null || hit.faceIndex === undefined || !hit.barycoord) continue;
      const { x, y, z } = hit.barycoord;
      const place = { corners: this.surface.cornersOf(hit.faceIndex), weights: [x, y, z] as [number, number, number] };
      const rest = new THREE.Vector3(...this.surface.at(this.surface.rest, place));
      if (this.cutawayShown && this.cutPlane.removes(rest)) continue;
      const normal = new THREE.Vector3(...this.surface.at(this.surface.restNormals, place)).normalize();
      return { shown: hit.point.clone(), rest, normal };
    }
    return null;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.solid.dispose();
    this.wireframe.dispose();
    this.supports.dispose();
    this.cutaway?.dispose();
    this.shadow.material.map?.dispose();
    this.shadow.material.dispose();
    this.shadow.geometry.dispose();
  }
}

/** A touched point: where it is seen, where it is at rest, and the outward normal there at rest. */
export interface Pick {
  shown: THREE.Vector3;
  rest: THREE.Vector3;
  normal: THREE.Vector3;
}

function same(a: Float32Array | Uint8Array, b: Float32Array | Uint8Array): boolean {
  return a.length === b.length && a.every((value, i) => value === b[i]);
}
