// Which vertices of surfaces are seen from the camera, and where in the window: those that face it and that no triangle
// hides. Hiding is found by a picture of distances, coarse but with all triangles in it, drawn here and not read back from
// the graphics card.

import type { Place } from "../window_regions";

/** Pixels of the window that a cell of the picture of distances is wide. */
const CELL = 3;
/** A vertex is hidden by what is nearer by more than this part of its own distance: cells are coarse, surfaces slanted. */
const NEARER = 0.01;

/** A surface as it is drawn: positions and normals (v, 3) in the scene, corners (k, 3), and vertices that are cut away. */
export interface SeenSurface {
  positions: Float32Array;
  normals: Float32Array;
  triangles: Uint32Array;
  removed: (vertex: number) => boolean;
}

/** What of the camera is needed: where it is, the product of projection and view by columns, and the window in pixels. */
export interface CameraView {
  position: readonly [number, number, number];
  matrix: ArrayLike<number>;
  left: number;
  top: number;
  width: number;
  height: number;
}

/** Vertices of a surface in the window: x, y in pixels and the inverse of the distance, zero behind the camera. */
type Projected = Float32Array;

/** The vertices of each surface that are seen, with their places in the window. */
export class SeenVertices {
  /** For each surface its vertices, and (x, y) of each. */
  readonly of: { vertices: Uint32Array; places: Float32Array }[];

  constructor(surfaces: readonly SeenSurface[], eye: CameraView) {
    const projected = surfaces.map((surface) => project(surface.positions, eye));
    const nearest = new Nearest(eye);
    surfaces.forEach((surface, i) => nearest.add(projected[i]!, surface));
    this.of = surfaces.map((surface, i) => seen(surface, projected[i]!, nearest, eye));
  }

  /** Vertices of each surface whose places meet a condition. */
  where(condition: (place: Place) => boolean): Uint32Array[] {
    return this.of.map(({ vertices, places }) =>
      vertices.filter((_, i) => condition([places[2 * i]!, places[2 * i + 1]!])),
    );
  }
}

function project(positions: Float32Array, { matrix: m, left, top, width, height }: CameraView): Projected {
  const found = new Float32Array(positions.length);
  for (let i = 0; i < positions.length; i += 3) {
    const [x, y, z] = [positions[i]!, positions[i + 1]!, positions[i + 2]!];
    // The last row of a perspective gives the distance along the line of sight.
    const w = m[3]! * x + m[7]! * y + m[11]! * z + m[15]!;
    if (w <= 0) continue;
    found[i] = left + (0.5 + (0.5 * (m[0]! * x + m[4]! * y + m[8]! * z + m[12]!)) / w) * width;
    found[i + 1] = top + (0.5 - (0.5 * (m[1]! * x + m[5]! * y + m[9]! * z + m[13]!)) / w) * height;
    found[i + 2] = 1 / w;
  }
  return found;
}

function seen({ positions, normals, removed }: SeenSurface, projected: Projected, nearest: Nearest, eye: CameraView) {
  const vertices: number[] = [];
  const places: number[] = [];
  const [ex, ey, ez] = eye.position;
  for (let vertex = 0; vertex < positions.length / 3; vertex++) {
    const i = 3 * vertex;
    const towards =
      (ex - positions[i]!) * normals[i]! + (ey - positions[i + 1]!) * normals[i + 1]! + (ez - positions[i + 2]!) * normals[i + 2]!;
    const [x, y, inverse] = [projected[i]!, projected[i + 1]!, projected[i + 2]!];
    if (towards <= 0 || inverse === 0 || removed(vertex) || nearest.hides(x, y, inverse)) continue;
    vertices.push(vertex);
    places.push(x, y);
  }
  return { vertices: Uint32Array.from(vertices), places: Float32Array.from(places) };
}

/** The inverse of the distance to what is nearest, at the middles of cells: it is linear over a triangle in the window. */
class Nearest {
  private readonly columns: number;
  private readonly rows: number;
  private readonly cells: Float32Array;

  constructor(private readonly eye: CameraView) {
    this.columns = Math.ceil(eye.width / CELL);
    this.rows = Math.ceil(eye.height / CELL);
    this.cells = new Float32Array(this.columns * this.rows);
  }

  add(projected: Projected, { triangles, removed }: SeenSurface): void {
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [triangles[t]!, triangles[t + 1]!, triangles[t + 2]!];
      if (removed(a) || removed(b) || removed(c)) continue;
      if (projected[3 * a + 2] && projected[3 * b + 2] && projected[3 * c + 2]) this.draw(projected, 3 * a, 3 * b, 3 * c);
    }
  }

  /** A vertex is hidden if it is in all cells around it: at an outline its own cell may be covered by what is before it. */
  hides(x: number, y: number, inverse: number): boolean {
    const column = Math.floor((x - this.eye.left) / CELL);
    const row = Math.floor((y - this.eye.top) / CELL);
    if (column < 0 || row < 0 || column >= this.columns || row >= this.rows) return true;
    for (let j = Math.max(row - 1, 0); j <= Math.min(row + 1, this.rows - 1); j++) {
      for (let i = Math.max(column - 1, 0); i <= Math.min(column + 1, this.columns - 1); i++) {
        if (inverse >= this.cells[j * this.columns + i]! * (1 - NEARER)) return false;
      }
    }
    return true;
  }

  private draw(p: Projected, a: number, b: number, c: number): void {
    const cell = (at: number, from: number) => (at - from) / CELL - 0.5;
    const { left, top } = this.eye;
    const [ax, bx, cx] = [cell(p[a]!, left), cell(p[b]!, left), cell(p[c]!, left)];
    const [ay, by, cy] = [cell(p[a + 1]!, top), cell(p[b + 1]!, top), cell(p[c + 1]!, top)];
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (area === 0) return;
    const [low, high] = [Math.max(Math.ceil(Math.min(ay, by, cy)), 0), Math.min(Math.floor(Math.max(ay, by, cy)), this.rows - 1)];
    const [first, last] = [Math.max(Math.ceil(Math.min(ax, bx, cx)), 0), Math.min(Math.floor(Math.max(ax, bx, cx)), this.columns - 1)];
    for (let y = low; y <= high; y++) {
      for (let x = first; x <= last; x++) {
        const wb = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area;
        const wc = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area;
        if (wb < 0 || wc < 0 || wb + wc > 1) continue;
        const inverse = (1 - wb - wc) * p[a + 2]! + wb * p[b + 2]! + wc * p[c + 2]!;
        const at = y * this.columns + x;
        if (inverse > this.cells[at]!) this.cells[at] = inverse;
      }
    }
  }
}
