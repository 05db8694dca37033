"""Signed distance of the solid that triangles enclose, whatever holes, overlaps and orientation they have.

A point is inside where the generalised winding number of the triangles (Jacobson, Kavan and Sorkine-Hornung 2013; fast
sums by Barill et al. 2018) is above a half. The field is the distance to the triangles with that sign; across a hole,
where no triangle is near, it goes through zero with the winding number. It is computed where the surface is near, level
by level. Lengths in parts of the longest side of the surface. Used in the mesher's own process only.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from palpate.mesh.triangles import area_vectors, areas, units

# Surfaces of more triangles are thinned out on a grid of so many cells along the longest side.
MOST_TRIANGLES, THINNED = 150_000, 200
# Vertices of other surfaces are the same in cells of this part of the longest side.
SAME = 2**20
# Where there are more triangles than this whose height is below this part of their longest edge, their vertices are
# thinned out too: the winding number of 8,000 needles, as around a cylinder of 2,000 sides, took a minute and a half.
MOST_NEEDLES, NEEDLE, THINNED_NEEDLES = 500, 0.01, 100
# Spacing of the coarsest level in cells of the finest. A point of spacing s stands for those up to s - 1 cells away
# along each axis, unless one of them may lie within a cell of the surface.
COARSEST, DIAGONAL = 8, 3**0.5
# Where the winding number is this near to a half, a hole may be near although no triangle is.
UNSURE = 0.45
# Steepness of the sign in the winding number: near triangles it is 1 or -1 unless the hole is as near.
STEEPNESS = 8.0
# Parts whose orientation is compared with the others around them.
MOST_INVERTED = 32
# Cells around the surface.
MARGIN = 3


def cleaned(vertices: np.ndarray, faces: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge vertices and drop doubled triangles; many, or many needles, are thinned out, vertices to their means."""
    # Vertices of the same cell become one.
    coarse = THINNED if len(faces) > MOST_TRIANGLES else THINNED_NEEDLES
    thinned = _thinned(vertices, faces)
    places = np.rint(vertices * np.where(thinned, coarse, SAME)[:, None]).astype(np.int64)
    # Numbers of the coarse cells are not those of fine ones.
    places[thinned, 0] += SAME + 1
    _, index, counts = np.unique(places @ [1, 2 * SAME, 4 * SAME**2], return_inverse=True, return_counts=True)
    merged = np.column_stack([np.bincount(index, vertices[:, k]) for k in range(3)]) / counts[:, None]
    faces = index.ravel()[faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces, labels = faces[kept], labels[kept]
    ordered = np.sort(faces, axis=1)
    _, first = np.unique(ordered @ [1, len(merged), len(merged) ** 2], return_index=True)
    first.sort()
    return merged, np.ascontiguousarray(faces[first]), labels[first]


def _thinned(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Mask of the vertices that are thinned out."""
    if len(faces) > MOST_TRIANGLES:
        return np.ones(len(vertices), dtype=bool)
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    needles = 2 * areas(vertices, faces) < NEEDLE * longest**2
    chosen = np.zeros(len(vertices), dtype=bool)
    if needles.sum() > MOST_NEEDLES:
        chosen[faces[needles]] = True
    return chosen


def oriented(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Turn triangles so that neighbours agree with most of the area of each patch, and inverted parts round."""
    directed = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2) @ [1, len(vertices)]
    agreeing, patch = np.unique(directed).size == directed.size, np.zeros(len(faces), dtype=np.int64)
    turned = faces
    if not agreeing:
        turned, patch = igl.bfs_orient(faces)
        patch = np.asarray(patch).ravel()
        kept = (np.asarray(turned) == faces).all(axis=1)
        area = areas(vertices, faces)
        turned = np.where(kept[:, None], faces, faces[:, ::-1])
        against = np.bincount(patch, area * ~kept) > np.bincount(patch, area * kept)
        turned = np.where(against[patch][:, None], turned[:, ::-1], turned)
    return np.ascontiguousarray(_outward(vertices, turned))


def _outward(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Turn parts of negative volume round, unless they bound a cavity of another part."""
    a, b = faces[:, :2].T, faces[:, 1:].T
    links = coo_array((np.ones(2 * len(faces)), (np.concatenate(a), np.concatenate(b))), shape=(len(vertices),) * 2)
    part = connected_components(links, directed=False)[1][faces[:, 0]]
    corners = vertices[faces]
    signed = np.einsum("ij,ij->i", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) / 6.0
    # Of an open part by its own middle.
    middle = np.column_stack([np.bincount(part, corners[:, :, k].mean(axis=1)) for k in range(3)])
    middle /= np.maximum(np.bincount(part), 1)[:, None]
    volume = np.bincount(part, signed - np.einsum("ij,ij->i", middle[part], area_vectors(corners) / 3.0))
    inverted = np.argsort(volume)[:MOST_INVERTED]
    for number in inverted[volume[inverted] < 0]:
        own = part == number
        others = np.ascontiguousarray(faces[~own])
        inside = len(others) and abs(igl.fast_winding_number(vertices, others, corners[own][0].mean(axis=0)[None])[0])
        if inside < 0.5:
            faces = np.where(own[:, None], faces[:, ::-1], faces)
    return faces


@dataclass(frozen=True, eq=False)
class Grid:
    """Values (nx, ny, nz) on points ``origin + cell * (i, j, k)``."""

    origin: np.ndarray
    cell: float
    values: np.ndarray

    def indices(self, points: np.ndarray) -> tuple[np.ndarray, ...]:
        """Nearest places in the array, clipped to it."""
        near = np.rint((points - self.origin) / self.cell).astype(np.int64)
        return tuple(np.clip(near, 0, np.array(self.values.shape) - 1).T)


class SolidField:
    """The field of a surface, on grids."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        import igl

        self.vertices, self.faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)
        self._winding, self._tree = igl.FastWindingNumberBVH(), igl.AABB()
        self._winding.init(self.vertices, self.faces)
        self._tree.init(self.vertices, self.faces)

    def winding(self, points: np.ndarray) -> np.ndarray:
        """Size of the winding number, for a part that is inside out counts as one."""
        return np.abs(self._winding.winding_number(np.ascontiguousarray(points)))

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Distances of points (k, 3) from the triangles."""
        return np.sqrt(self._tree.squared_distance(self.vertices, self.faces, np.ascontiguousarray(points))[0].ravel())

    def on_grid(self, low: np.ndarray, high: np.ndarray, cell: float) -> tuple[Grid, bool]:
        """Evaluate it on a box and a margin; and whether winding numbers are 0 and 1, as of a closed surface."""
        origin = low - (MARGIN - 0.5) * cell
        counts = np.ceil((high - origin) / cell).astype(np.int64) + MARGIN
        shape = (counts + COARSEST) // COARSEST * COARSEST + 1
        stride = COARSEST
        places = np.stack(np.meshgrid(*(np.arange(0, n, stride) for n in shape), indexing="ij"), axis=-1)
        lattice, whole = places.shape[:3], True
        values, near, sure = self._evaluate(places.reshape(-1, 3), origin, cell, stride)
        values, near = values.reshape(lattice), near.reshape(lattice)
        whole &= sure
        while stride > 1:
            stride //= 2
            fine = tuple(2 * n - 1 for n in values.shape)
            # Each finer point takes the value of a coarser one beside it, unless that is near the surface.
            parent = [np.minimum((np.arange(n) + 1) // 2, m - 1) for n, m in zip(fine, values.shape, strict=True)]
            values, near = values[np.ix_(*parent)], near[np.ix_(*parent)]
            todo = np.argwhere(near)
            found, still, sure = self._evaluate(todo * stride, origin, cell, stride)
            whole &= sure
            values[near], near[near] = found, still
        # Zeros would give triangles without an area.
        tiny = 1e-6 * cell
        return Grid(origin, cell, np.where(np.abs(values) < tiny, tiny, values)), whole

    def _evaluate(
        self, places: np.ndarray, origin: np.ndarray, cell: float, stride: int
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        points = np.ascontiguousarray(origin + cell * places)
        winding = self.winding(points)
        distance = self.distances(points)
        values = distance * np.clip(STEEPNESS * (0.5 - winding), -1, 1)
        near = (distance < (DIAGONAL * (stride - 1) + 1) * cell) | (np.abs(winding - 0.5) < UNSURE)
        clear = np.abs(winding[distance > cell] - 0.5)
        return values, near, bool((np.abs(clear - 0.5) < 0.05).all())

    def samples(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Points (k, 3) spread over the triangles, and their unit normals (k, 3)."""
        area = areas(self.vertices, self.faces)
        total = np.cumsum(area)
        random = np.random.default_rng(0)
        chosen = np.searchsorted(total, (np.arange(count) + random.uniform(size=count)) / count * total[-1])
        corners = self.vertices[self.faces[np.minimum(chosen, len(area) - 1)]]
        u, v = np.sqrt(random.uniform(size=(count, 1))), random.uniform(size=(count, 1))
        points = (1 - u) * corners[:, 0] + u * (1 - v) * corners[:, 1] + u * v * corners[:, 2]
        return points, units(area_vectors(corners))

    def boundary_samples(self, count: int, step: float) -> np.ndarray:
        """Points (k, 3) on triangles with the inside on one side and the outside on the other, ``step`` away."""
        points, normals = self.samples(count)
        sides = [self.winding(points + sign * step * normals) > 0.5 for sign in (1, -1)]
        return points[sides[0] != sides[1]]
