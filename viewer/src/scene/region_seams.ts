// Triangles whose corners belong to one region each: where regions meet on a surface its nodes are there once for each.

/** Vertices to draw: the surface row of each, its region, and the triangles' corners among them. */
export interface Seams {
  rows: Uint32Array;
  regions: Float32Array;
  triangles: Uint32Array;
}

/** The first vertices are the rows themselves. */
export function splitAtSeams(triangles: Uint32Array, regionOf: Uint32Array, count: number): Seams {
  const rows = Array.from({ length: count }, (_, row) => row);
  const regions: number[] = new Array<number>(count).fill(-1);
  const others = new Map<string, number>();
  const corners = triangles.map((row, corner) => {
    const region = regionOf[Math.floor(corner / 3)]!;
    if (regions[row]! < 0) regions[row] = region;
    if (regions[row] === region) return row;
    const key = `${row} ${region}`;
    const vertex = others.get(key) ?? rows.length;
    if (vertex === rows.length) {
      others.set(key, vertex);
      rows.push(row);
      regions.push(region);
    }
    return vertex;
  });
  return { rows: new Uint32Array(rows), regions: new Float32Array(regions), triangles: corners };
}
