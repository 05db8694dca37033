"""A closed manifold around the solid of any triangles: zero of its field, of the parts that are wanted.

Lengths in parts of the longest side of the surface. Used in the mesher's own process only.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy import ndimage
from skimage.measure import marching_cubes

from palpate.mesh.inner_triangles import simplified
from palpate.mesh.solid_field import Grid, SolidField
from palpate.mesh.triangles import areas, volume_within

# Parts below this share of the largest are crumbs, and so are cavities of fewer cells.
CRUMB, LEAST_CAVITY = 0.01, 64
# The grid is laid around the wanted part alone where that is smaller than this share of the surface.
SMALL_PART = 0.6
# Points within so many cells of the wrap are near it.
NEAR = 2
# By simplifying, the wrap moves by at most this many cells of the first grid, which a finer one does not change:
# fTetWild's time grows with the triangles.
SIMPLIFIED = 0.3
# Points on the surface that are looked for on the wrap; one farther than so many cells is on a wall that was lost.
# Where these are more than this share, the grid is made finer, at most to so many cells.
SAMPLES, LOST_WALL, LOST_SHARE, MOST_CELLS = 8000, 1.5, 0.02, 160
# What an open surface encloses lies behind its triangles. Of a sheet it lies before more than this share of them.
BOTH_SIDES = 0.15
# Points on the wrap that are looked for on the surface.
WRAP_SAMPLES = 2000


class WrapError(Exception):
    """Triangles that enclose nothing, or a part that is not there; the message is for the user."""


@dataclass(frozen=True, eq=False)
class Part:
    """A connected part of the solid: its volume, middle and sides (3,), and the label of its triangles (-1: none)."""

    volume: float
    middle: np.ndarray
    sides: np.ndarray
    label: int


@dataclass(frozen=True, eq=False)
class Wrap:
    """What was wrapped."""

    # Of the closed manifold (n, 3), (k, 3).
    vertices: np.ndarray
    faces: np.ndarray
    parts: list[Part]  # of the solid, the largest first
    volume: float  # of the wanted parts, by the winding number or exactly
    cell: float  # of the grid
    points: np.ndarray  # points (k, 3) of the given surface beside the wrap
    lost_points: np.ndarray  # points (k, 3) of walls that the grid lost
    lost_share: float  # of the surface of what is wanted
    closed_share: float  # of the wrap that closes holes: no triangle of the surface is near
    band: Grid  # mask of the points within so many cells of the wrap


def wrap(field: SolidField, labels: np.ndarray, part: int | None, cells: int) -> Wrap:
    """Wrap a part by its rank, or all of them (None), on a grid of so many cells or more along the longest side.

    Raises WrapError for triangles without an inside, or fewer parts.
    """
    moved = SIMPLIFIED / cells
    while True:
        candidate = _wrap(field, labels, part, cells, moved)
        if candidate.lost_share <= LOST_SHARE or cells >= MOST_CELLS:
            return candidate
        cells = min(2 * cells, MOST_CELLS)


def _wrap(field: SolidField, labels: np.ndarray, part: int | None, cells: int, moved: float) -> Wrap:
    low, high = field.vertices.min(axis=0), field.vertices.max(axis=0)
    grid, whole = field.on_grid(low, high, 1.0 / cells)
    if not whole:
        _require_one_side(field, grid.cell)
    label, parts, crumbs = _parts(grid, field, labels)
    wanted = range(len(parts)) if part is None else [part - 1]
    if part is not None and not 1 <= part <= len(parts):
        raise WrapError(f"there is no part {part}: the surface has {len(parts)}")
    kept = np.isin(label, [rank + 1 for rank in wanted])
    volume = sum(parts[rank].volume for rank in wanted)
    if whole:
        # Exact, less what was left out.
        others = sum(parts[rank].volume for rank in range(len(parts)) if rank not in wanted)
        volume = abs(volume_within(field.vertices, field.faces)) - others
    elif part is None or len(parts) == 1:
        volume += crumbs
    fine = _around(field, grid, label, kept, cells)
    grid, kept = (grid, kept) if fine is None else fine
    only = _only(grid, kept)
    vertices, faces = _zero(only, moved)
    points, lost = _beside_and_lost(field, vertices, faces, grid, label if fine is None else None, kept)
    share = len(lost) / max(len(lost) + len(points), 1)
    closed = _closed_share(field, vertices, faces, grid.cell)
    return Wrap(vertices, faces, parts, volume, grid.cell, points, lost, share, closed, _band(only))


def _require_one_side(field: SolidField, cell: float) -> None:
    """Raise WrapError for a sheet: what it encloses lies on both of its sides."""
    points, normals = field.samples(SAMPLES)
    before, behind = (field.winding(points + sign * 0.05 * cell * normals) > 0.5 for sign in (1, -1))
    bounding = before != behind
    if bounding.any():
        share = float(before[bounding].mean())
        if min(share, 1 - share) > BOTH_SIDES:
            raise WrapError("it encloses nothing: it is a sheet, which has no inside")


def _closed_share(field: SolidField, vertices: np.ndarray, faces: np.ndarray, cell: float) -> float:
    """Share of the area of a wrap without a triangle of the surface near."""
    corners = vertices[faces]
    total = np.cumsum(areas(vertices, faces))
    random = np.random.default_rng(0)
    chosen = np.minimum(np.searchsorted(total, random.uniform(size=WRAP_SAMPLES) * total[-1]), len(faces) - 1)
    weights = random.dirichlet(np.ones(3), WRAP_SAMPLES)
    points = np.einsum("ik,ikj->ij", weights, corners[chosen])
    return float((field.distances(points) > LOST_WALL * cell).mean())


def _parts(grid: Grid, field: SolidField, labels: np.ndarray) -> tuple[np.ndarray, list[Part], float]:
    """Return the number of the part of each point, 0 outside and in crumbs; the parts; and the volume of the crumbs."""
    found, count = ndimage.label(grid.values < 0)
    if count == 0:
        raise WrapError("it encloses nothing: its triangles have no inside")
    # Cells that the surface cuts count by their share.
    share = np.clip(0.5 - grid.values / grid.cell, 0, 1)
    nearest = ndimage.distance_transform_edt(found == 0, return_distances=False, return_indices=True)
    owner = found[tuple(nearest)]
    volumes = np.bincount(owner.ravel(), share.ravel(), minlength=count + 1)[1:] * grid.cell**3
    order = np.argsort(-volumes, kind="stable")
    order = order[volumes[order] >= CRUMB * volumes[order[0]]]
    number = np.zeros(count + 1, dtype=np.int64)
    number[order + 1] = np.arange(len(order)) + 1
    # Which named mesh the triangles beside a part are mostly of.
    of_face = number[owner[grid.indices(field.vertices[field.faces].mean(axis=1))]]
    parts = []
    for rank, box in enumerate(ndimage.find_objects(number[found]), 1):
        low, high = (grid.origin + grid.cell * np.array([getattr(s, end) for s in box]) for end in ("start", "stop"))
        names = np.bincount(labels[(of_face == rank) & (labels >= 0)])
        own = int(names.argmax()) if names.size else -1
        parts.append(Part(volumes[order[rank - 1]], 0.5 * (low + high - grid.cell), high - low, own))
    return number[found], parts, float(volumes.sum() - volumes[order].sum())


def _around(
    field: SolidField, grid: Grid, label: np.ndarray, kept: np.ndarray, cells: int
) -> tuple[Grid, np.ndarray] | None:
    """Make a finer grid around what is wanted, and that on it, if it is small beside the whole surface."""
    places = np.argwhere(kept)
    low, high = places.min(axis=0), places.max(axis=0) + 1
    extent = float((high - low).max()) * grid.cell
    if extent > SMALL_PART:
        return None
    fine, _ = field.on_grid(grid.origin + (low - 1) * grid.cell, grid.origin + high * grid.cell, extent / cells)
    points = np.stack(np.meshgrid(*map(np.arange, fine.values.shape), indexing="ij"), axis=-1).reshape(-1, 3)
    coarse = grid.indices(fine.origin + fine.cell * points)
    # What thin walls the coarse grid lost beside the part is its own, unless another part is as near.
    nearest = ndimage.distance_transform_edt(label == 0, return_distances=False, return_indices=True)
    own = kept[tuple(nearest)][coarse].reshape(fine.values.shape)
    found, _ = ndimage.label((fine.values < 0) & own)
    numbers = np.bincount(found.ravel())[1:]
    return fine, np.isin(found, np.flatnonzero(numbers > CRUMB * numbers.max(initial=0)) + 1)


def _only(grid: Grid, kept: np.ndarray) -> Grid:
    """Return the field of what is wanted alone, without cavities of a few cells."""
    values = np.where((grid.values < 0) & ~kept, -grid.values, grid.values)
    outside, count = ndimage.label(values > 0)
    sizes = np.bincount(outside.ravel(), minlength=count + 1)
    sizes[[0, outside[0, 0, 0]]] = LEAST_CAVITY
    bubble = sizes[outside] < LEAST_CAVITY
    return Grid(grid.origin, grid.cell, np.where(bubble, -values, values))


def _band(grid: Grid) -> Grid:
    inside = grid.values < 0
    near = ndimage.binary_dilation(inside, iterations=NEAR) & ~ndimage.binary_erosion(inside, iterations=NEAR)
    return Grid(grid.origin, grid.cell, near)


def _zero(grid: Grid, moved: float) -> tuple[np.ndarray, np.ndarray]:
    """Zero of a field as a closed manifold of few triangles, which lies this far off it at most."""
    vertices, faces, _, _ = marching_cubes(grid.values, 0.0, spacing=(grid.cell,) * 3)
    try:
        vertices, faces = simplified(vertices, faces, moved)
    except ValueError as status:
        raise WrapError(f"its wrap is no manifold ({status})") from None
    return vertices + grid.origin, faces


def _beside_and_lost(
    field: SolidField, vertices: np.ndarray, faces: np.ndarray, grid: Grid, label: np.ndarray | None, kept: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the surface between inside and outside that the wrap is near, and those that it is not."""
    points = field.boundary_samples(SAMPLES, 0.05 * grid.cell)
    inside = ((points > grid.origin) & (points < grid.origin + grid.cell * (np.array(kept.shape) - 1))).all(axis=1)
    points = points[inside]
    if label is not None:
        # Those of parts that are left out.
        near_others = ndimage.binary_dilation((label > 0) & ~kept, iterations=2)
        points = points[~near_others[grid.indices(points)]]
    elif len(points):
        points = points[ndimage.binary_dilation(kept, iterations=3)[grid.indices(points)]]
    if len(points) == 0:
        return points, points
    squared = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)[0]
    lost = np.asarray(squared).ravel() > (LOST_WALL * grid.cell) ** 2
    return points[~lost], points[lost]
