// The deformed solid, with the colours of a field or of its regions over it, less what is cut away.

import * as THREE from "three";

import { createFieldMaterial, noCut } from "./field_material";
import type { CutUniform, FieldUniforms } from "./field_material";
import { SHOWN_SCALE_MAX } from "../store";
import { splitAtSeams } from "./region_seams";
import type { Seams } from "./region_seams";
import type { Surface } from "./surface";

/** One byte for each colour of marks. */
const MARK_SIZE = 4;

export class SolidView {
  /** Its triangles are those of the surface, in their order. */
  readonly mesh: THREE.Mesh<THREE.BufferGeometry, THREE.MeshPhysicalMaterial>;
  private readonly seams: Seams;
  private readonly scalar: THREE.BufferAttribute;
  private readonly position: THREE.BufferAttribute;
  private readonly normal: THREE.BufferAttribute;
  private readonly mark: THREE.BufferAttribute;
  private readonly cutPlane: CutUniform = noCut();

  constructor(
    private readonly surface: Surface,
    color: THREE.Color,
    size: number,
    uniforms: FieldUniforms,
    regions: Uint32Array,
  ) {
    const geometry = new THREE.BufferGeometry();
    this.seams = splitAtSeams(surface.triangles, regions, surface.count);
    const { rows, regions: ofRows, triangles } = this.seams;
    const dynamic = (array: THREE.TypedArray, itemSize: number, normalized = false) =>
      new THREE.BufferAttribute(array, itemSize, normalized).setUsage(THREE.DynamicDrawUsage);
    const rest = gathered(surface.rest, rows, 3);
    this.scalar = dynamic(new Uint8Array(rows.length), 1, true);
    this.position = dynamic(rest.slice(), 3);
    this.normal = dynamic(gathered(surface.shownNormals, rows, 3), 3);
    this.mark = dynamic(new Uint8Array(MARK_SIZE * rows.length), MARK_SIZE, true);
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    geometry.setAttribute("position", this.position);
    geometry.setAttribute("normal", this.normal);
    geometry.setAttribute("scalar", this.scalar);
    geometry.setAttribute("mark", this.mark);
    geometry.setAttribute("region", new THREE.BufferAttribute(ofRows, 1));
    geometry.setAttribute("rest", new THREE.BufferAttribute(rest, 3));
    geometry.setAttribute("shade", new THREE.BufferAttribute(mottle(rest, size), 1));
    geometry.computeBoundingSphere();
    // Room for the largest deformation as it may be drawn, so that the sphere that picking consults never goes stale.
    geometry.boundingSphere!.radius += (SHOWN_SCALE_MAX * size) / 2;
    const material = createFieldMaterial(
      {
        color,
        roughness: 0.38,
        // Lines of the rest shape lie in the same place where nothing moves: push the solid behind them.
        polygonOffset: true,
        polygonOffsetFactor: 1,
        polygonOffsetUnits: 1,
      },
      uniforms,
      this.cutPlane,
    );
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false;
  }

  /** Call after the surface was displaced. */
  update(scalar: Uint8Array): void {
    const { surface, seams } = this;
    if (scalar.length === surface.count) gather(scalar, seams.rows, 1, this.scalar.array as Uint8Array);
    gather(surface.shown, seams.rows, 3, this.position.array as Float32Array);
    gather(surface.shownNormals, seams.rows, 3, this.normal.array as Float32Array);
    for (const attribute of [this.scalar, this.position, this.normal]) attribute.needsUpdate = true;
  }

  /** Colours vertices by what they are: 0 as it is, else the rank of a colour of marks, from 1. */
  showMarks(marks: Uint8Array): void {
    const into = this.mark.array as Uint8Array;
    into.fill(0);
    this.seams.rows.forEach((row, vertex) => {
      if (marks[row]! > 0) into[MARK_SIZE * vertex + marks[row]! - 1] = 255;
    });
    this.mark.needsUpdate = true;
  }

  /** Leaves out what lies beyond a plane at rest; all is drawn without one. */
  cut(plane: { normal: THREE.Vector3; offset: number } | null): void {
    const { normal, offset } = plane ?? { normal: new THREE.Vector3(), offset: 1 };
    this.cutPlane.value.set(...normal.toArray(), offset);
  }
}

/** Rows of an array with a number of columns, one after the other. */
function gather<T extends Float32Array | Uint8Array>(from: T, rows: Uint32Array, columns: number, into: T): T {
  for (let i = 0; i < rows.length; i++) {
    for (let k = 0; k < columns; k++) into[columns * i + k] = from[columns * rows[i]! + k]!;
  }
  return into;
}

function gathered(from: Float32Array, rows: Uint32Array, columns: number): Float32Array {
  return gather(from, rows, columns, new Float32Array(columns * rows.length));
}

/** Brightness of the tissue at each node: slow waves with no common period, within 8 %. */
function mottle(rest: Float32Array, size: number): Float32Array {
  const shades = new Float32Array(rest.length / 3);
  for (let i = 0; i < shades.length; i++) {
    const [x, y, z] = [rest[3 * i]! / size, rest[3 * i + 1]! / size, rest[3 * i + 2]! / size];
    const waves = Math.sin(23 * x + 11 * y) + Math.sin(19 * y - 13 * z + 1) + Math.sin(29 * z + 17 * x + 2);
    shades[i] = 1 + 0.027 * waves;
  }
  return shades;
}
