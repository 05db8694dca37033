// Everything drawn of a body, where it stands in the scene: solid, face of a cut, rest wire frame, supports, and the shadow.

import * as THREE from "three";

import type { BodyArrays, BodyMessage, PoseArrays, Vec3 } from "../net/protocol";
import type { Layer, Theme } from "../store";
import { ColorMap } from "./color_map";
import { tissueColor } from "./field_material";
import type { FieldShares, FieldUniforms } from "./field_material";
import { createGroundShadow } from "./ground_shadow";
import { firstEntry } from "./ray_surface";
import { regionTexture } from "./region_texture";
import { release } from "./release";
import { SectionView } from "./section_view";
import type { SeenSurface } from "./seen_vertices";
import { SolidView } from "./solid_view";
import { SupportsView } from "./supports_view";
import { Surface } from "./surface";
import type { SurfacePoint } from "./surface";
import { WireframeView } from "./wireframe_view";

/** A point of the surface while nothing touches it, in the scene, m: where it is, the outward normal, and where it is drawn. */
export interface UntouchedPoint {
  point: THREE.Vector3;
  normal: THREE.Vector3;
  drawn: THREE.Vector3;
}

/** A point of a body that is seen. */
export interface Pick extends UntouchedPoint {
  body: number;
  /** Corners of the triangle that is seen there, as vertices. */
  corners: [number, number, number];
  /** Where it is seen now. */
  shown: THREE.Vector3;
  /** How deep other tools have pressed the surface in there, along the normal, m. */
  dent: number;
  /** In the body's frame: the same point at rest under the body's own loads, and the normal. */
  inBody: { settled: Vec3; normal: Vec3 };
}

/** What a ray meets of a body; no pick where that is the inside that a cut shows. */
export interface Hit {
  distance: number;
  pick: Pick | null;
}

/** A body in a frame: what moves it, and whether anything touches it. */
export interface Pose {
  arrays: PoseArrays;
  interior: boolean;
  signed: boolean;
  /** Whether a value of 0 stands for none. */
  gaps: boolean;
  touched: boolean;
  /** A mode shape is drawn in place of its motion. */
  showsMode: boolean;
}

/** Colour of the wire frame, seen against the backdrop as against the body, and how dark the shadow is. */
const THEME_COLORS: Record<Theme, { wire: number; shadow: number }> = {
  dark: { wire: 0xf2f5fa, shadow: 0.85 },
  light: { wire: 0x1d2733, shadow: 0.5 },
};

export class BodyView {
  readonly group = new THREE.Group();
  /** In the frame of the body. */
  readonly placed = new THREE.Group();
  readonly surface: Surface;
  /** At rest, in the scene. */
  readonly restInScene: Float32Array;
  readonly bounds = new THREE.Box3();
  private readonly uniforms: FieldUniforms;
  private readonly solid: SolidView;
  /** The solid as picking sees it: where a ray leaves the body tells what it has passed. */
  private readonly bothSides: THREE.Mesh<THREE.BufferGeometry, THREE.MeshBasicMaterial>;
  private readonly wireframe: WireframeView;
  private readonly supports: SupportsView;
  private readonly shadow: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;
  /** Made on first use: most people never cut. */
  private section: SectionView | null = null;
  private cutShown = false;
  /** In the frame of the body, at rest. */
  private readonly plane = { normal: new THREE.Vector3(0, 0, 1), offset: Infinity };
  private drawn: Pose | null = null;
  private touched = false;
  /** Displacements are drawn so many times. */
  private scale = 1;

  /** size is that of the scene, m. */
  constructor(
    private readonly index: number,
    private readonly header: BodyMessage,
    private readonly arrays: BodyArrays,
    size: number,
  ) {
    const tissue = tissueColor(header.name);
    this.uniforms = {
      colorMap: { value: ColorMap.sequential.texture },
      regionColors: { value: regionTexture([tissue]) },
      byRegion: { value: false },
      fieldShares: { value: new THREE.Vector2(0, 1) },
      signed: { value: false },
      grain: { value: 1 / size },
      gaps: { value: false },
      marked: { value: false },
    };
    const [w, x, y, z] = header.orientation;
    this.placed.position.set(...header.position);
    this.placed.quaternion.set(x, y, z, w);
    this.placed.updateMatrix();
    this.surface = new Surface(arrays);
    this.restInScene = transformed(this.surface.rest, this.placed.matrix);
    this.bounds.setFromArray(this.restInScene);
    this.solid = new SolidView(this.surface, tissue, size, this.uniforms, arrays.triangle_regions);
    this.bothSides = new THREE.Mesh(this.solid.mesh.geometry, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    this.bothSides.matrixWorld.copy(this.placed.matrix);
    this.wireframe = new WireframeView(this.surface);
    this.supports = new SupportsView(arrays, size);
    this.shadow = createGroundShadow(this.restInScene, this.surface.triangles, size);
    this.placed.add(this.solid.mesh, this.wireframe.lines, this.supports.markers);
    this.group.add(this.shadow, this.placed);
  }

  show(layers: Readonly<Record<Layer, boolean>>): void {
    this.wireframe.lines.visible = layers.wireframe;
    this.supports.markers.visible = layers.supports;
    // A body from a bare store has no inside.
    this.cutShown = layers.cutaway && this.arrays.tets.length > 0;
    if (this.cutShown && !this.section) {
      this.section = new SectionView(this.arrays, tissueColor(this.header.name), this.uniforms);
      this.placed.add(this.section.mesh);
    }
    if (this.section) this.section.mesh.visible = this.cutShown;
    this.applyCut();
    // What is shown from now on has not seen the frames before.
    this.drawn = null;
  }

  /** How much of the colours of the field is seen over the tissue. */
  shareField({ everywhere, strained }: FieldShares): void {
    this.uniforms.byRegion.value = false;
    this.uniforms.fieldShares.value.set(everywhere, strained);
  }

  /** Colours of regions, one for each; a body that tells of none keeps that of its tissue. */
  colorRegions(colors: THREE.Color[]): void {
    const { regionColors, byRegion } = this.uniforms;
    regionColors.value.dispose();
    regionColors.value = regionTexture(colors.length > 0 ? colors : [tissueColor(this.header.name)]);
    byRegion.value = true;
  }

  /** Colours what cannot be touched yet: what each node of the whole surface is (see painting.ts); null where all can. */
  mark(states: Uint8Array | null): void {
    this.uniforms.marked.value = states !== null;
    if (states) this.solid.showMarks(this.largestOfVertices(states));
  }

  /** Colours the vertices at whose place, at rest in the body's frame, a condition holds. */
  markWhere(mark: number, holds: (place: Vec3) => boolean): void {
    const { rest, count } = this.surface;
    this.uniforms.marked.value = true;
    const at = (i: number): Vec3 => [rest[3 * i]!, rest[3 * i + 1]!, rest[3 * i + 2]!];
    this.solid.showMarks(Uint8Array.from({ length: count }, (_, i) => (holds(at(i)) ? mark : 0)));
  }

  /** Lets what is inside of the body be seen through it. */
  setOpacity(opacity: number): void {
    const { material } = this.solid.mesh;
    // The lines of the far side would cover what is inside.
    this.wireframe.lines.visible &&= opacity === 1;
    if (material.opacity === opacity) return;
    material.transparent = opacity < 1;
    material.depthWrite = opacity === 1;
    material.opacity = opacity;
    material.needsUpdate = true;
  }

  /** Nodes of the whole surface that vertices stand for, ascending. */
  nodesOf(vertices: ReadonlySet<number>): Uint32Array {
    const { owners } = this.arrays;
    if (owners.length === 0) return Uint32Array.from(vertices).sort();
    const nodes: number[] = [];
    owners.forEach((vertex, node) => {
      if (vertices.has(vertex)) nodes.push(node);
    });
    return Uint32Array.from(nodes);
  }

  /** The surface as it is drawn, in the scene. */
  seenSurface(): SeenSurface {
    const { surface, placed } = this;
    const normals = new THREE.BufferAttribute(surface.shownNormals.slice(), 3);
    return {
      positions: transformed(surface.shown, placed.matrix),
      normals: new Float32Array(normals.applyNormalMatrix(new THREE.Matrix3().setFromMatrix4(placed.matrix)).array),
      triangles: surface.triangles,
      removed: (vertex) => this.removesAt(surface.rest[3 * vertex]!, surface.rest[3 * vertex + 1]!, surface.rest[3 * vertex + 2]!),
    };
  }

  /** Draws displacements times a scale from the next pose on. */
  exaggerate(scale: number): void {
    this.scale = scale;
    this.drawn = null;
  }

  /** Removes what lies beyond a plane of the scene, at rest. */
  cut(plane: THREE.Plane): void {
    const { normal, constant } = plane.clone().applyMatrix4(this.placed.matrix.clone().invert());
    this.plane.normal.copy(normal);
    this.plane.offset = -constant;
    this.applyCut();
  }

  setTheme(theme: Theme): void {
    const { wire, shadow } = THEME_COLORS[theme];
    this.wireframe.lines.material.color.set(wire);
    this.shadow.material.opacity = shadow;
  }

  /** Moves to a pose and returns whether the picture changes; one that belongs to another mesh is left out. */
  update(pose: Pose): boolean {
    const { displacements, scalar } = pose.arrays;
    const { arrays, drawn } = this;
    const expected = pose.interior ? arrays.nodes.length : arrays.surface_nodes.length * 3;
    if (displacements.length !== expected || displacements.length !== 3 * scalar.length) return false;
    if (drawn?.signed === pose.signed && drawn.gaps === pose.gaps && same(drawn.arrays.displacements, displacements)) {
      if (same(drawn.arrays.scalar, scalar)) return false;
    }
    this.drawn = pose;
    this.touched = pose.touched;
    this.uniforms.colorMap.value = (pose.signed ? ColorMap.diverging : ColorMap.sequential).texture;
    this.uniforms.signed.value = pose.signed;
    this.uniforms.gaps.value = pose.gaps;
    // A mode shape has a size of its own.
    const scale = pose.showsMode ? 1 : this.scale;
    this.surface.displace(displacements, pose.interior ? arrays.surface_nodes : null, scale);
    // A mode shape is only shown: a tool meets the body at rest.
    if (pose.showsMode) this.surface.settle();
    else if (!pose.touched) this.surface.storeAsUntouched();
    this.solid.update(pose.interior ? this.ofSurface(scalar) : scalar);
    // Until the server has heard that the inside is seen, frames are without it.
    if (this.cutShown && pose.interior) this.section?.displace({ displacements, scalar, scale });
    return true;
  }

  /** The point of the surface that is seen along a ray of the scene; null beside the body. */
  pick(raycaster: THREE.Raycaster): Hit | null {
    const direction = raycaster.ray.direction.clone().applyQuaternion(this.placed.quaternion.clone().invert());
    for (const { faceIndex, face, barycoord, point, distance } of raycaster.intersectObject(this.bothSides, false)) {
      if (faceIndex == null || !face || !barycoord) continue;
      const entering = face.normal.dot(direction) < 0;
      const removed = this.removes(faceIndex, barycoord.toArray());
      // A ray that comes out of what is left, and went in where the surface is gone, met a face of the cut between.
      if (!entering && !removed) return { distance, pick: null };
      if (!entering || removed) continue;
      return { distance, pick: this.pickAt(point, faceIndex, barycoord.toArray()) };
    }
    return null;
  }

  /** The untouched surface along a ray of the scene; null beside the body and where it is cut away. */
  untouchedAlong({ ray }: THREE.Raycaster): UntouchedPoint | null {
    const { surface, placed } = this;
    const { origin, direction } = ray.clone().applyMatrix4(placed.matrix.clone().invert());
    const skips = (triangle: number, weights: Vec3) => this.removes(triangle, weights);
    const hit = firstEntry(this.untouchedDrawn, surface.triangles, origin.toArray(), direction.toArray(), skips);
    return hit && this.untouchedAt({ corners: surface.cornersOf(hit.triangle), weights: hit.weights });
  }

  /** How much farther a point of the surface is drawn from where it is than it has moved, in the scene, m. */
  exaggerationAt(point: SurfacePoint): THREE.Vector3 {
    const { surface, placed } = this;
    const shown = new THREE.Vector3(...surface.at(surface.shown, point));
    return shown.sub(new THREE.Vector3(...surface.at(surface.positions, point))).applyQuaternion(placed.quaternion);
  }

  dispose(): void {
    release(this.group);
    this.bothSides.material.dispose();
    this.uniforms.regionColors.value.dispose();
  }

  private applyCut(): void {
    const { normal, offset } = this.plane;
    this.solid.cut(this.cutShown ? this.plane : null);
    this.supports.cut(this.cutShown ? this.plane : null);
    if (this.cutShown) this.section?.setPlane(normal, offset);
  }

  /** Whether a point of a triangle of the surface is cut away. */
  private removes(triangle: number, weights: Vec3): boolean {
    if (!this.cutShown) return false;
    return this.removesAt(...this.surface.at(this.surface.rest, { corners: this.surface.cornersOf(triangle), weights }));
  }

  /** Whether a point at rest is cut away. */
  private removesAt(x: number, y: number, z: number): boolean {
    const { normal, offset } = this.plane;
    return this.cutShown && normal.x * x + normal.y * y + normal.z * z > offset;
  }

  /** For each vertex the largest value of the nodes that it stands for. */
  private largestOfVertices(values: Uint8Array): Uint8Array {
    const { owners } = this.arrays;
    if (owners.length === 0) return values;
    const largest = new Uint8Array(this.surface.count);
    owners.forEach((vertex, node) => (largest[vertex] = Math.max(largest[vertex]!, values[node]!)));
    return largest;
  }

  /** Values of all nodes, at those of the surface. */
  private ofSurface(scalar: Uint8Array): Uint8Array {
    return Uint8Array.from(this.arrays.surface_nodes, (node) => scalar[node]!);
  }

  private pickAt(shown: THREE.Vector3, triangle: number, weights: Vec3): Pick {
    const { surface, placed } = this;
    const place = { corners: surface.cornersOf(triangle), weights };
    const untouched = this.untouchedAt(place);
    const now = new THREE.Vector3(...surface.at(surface.positions, place));
    const moved = now.sub(new THREE.Vector3(...surface.at(surface.untouched, place))).applyQuaternion(placed.quaternion);
    return {
      ...untouched,
      body: this.index,
      corners: place.corners,
      shown: shown.clone(),
      dent: this.touched ? -moved.dot(untouched.normal) : 0,
      inBody: { settled: surface.at(surface.settled, place), normal: surface.smoothPoint(place).normal },
    };
  }

  private untouchedAt(place: SurfacePoint): UntouchedPoint {
    const { surface, placed } = this;
    const { place: point, normal } = surface.smoothPoint(place);
    return {
      point: new THREE.Vector3(...point).applyMatrix4(placed.matrix),
      normal: new THREE.Vector3(...normal).applyQuaternion(placed.quaternion),
      drawn: new THREE.Vector3(...surface.at(this.untouchedDrawn, place)).applyMatrix4(placed.matrix),
    };
  }

  private get untouchedDrawn(): Float32Array {
    return this.scale === 1 ? this.surface.untouched : this.surface.untouchedAsShown(this.scale);
  }
}

function transformed(points: Float32Array, matrix: THREE.Matrix4): Float32Array {
  return new Float32Array(new THREE.BufferAttribute(points.slice(), 3).applyMatrix4(matrix).array);
}

function same(a: Float32Array | Uint8Array, b: Float32Array | Uint8Array): boolean {
  if (a.length !== b.length) return false;
  for (let i = 0; i < a.length; i++) if (a[i] !== b[i]) return false;
  return true;
}
