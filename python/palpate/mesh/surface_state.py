"""Defects of a surface, and the mesher that fills it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError, MeshWarning

if TYPE_CHECKING:
    import trimesh

# NETGEN reads a surface in a time that grows with its triangles, whatever it makes of it: 6 s at 30,000.
MOST_FOR_NETGEN = 20_000
# A triangle whose height is below this part of its longest edge is a needle: NETGEN took 19 s for a cylinder of 2,000
# sides.
NEEDLE = 1e-3
# So many triangles below this are as slow: NETGEN did not finish a cone of 2,000 sides in a minute.
MOST_SLENDER, SLENDER = 500, 1e-2
BY_HAND = "mend it in Blender or MeshLab"
# Cells along the longest side of the grid that finds triangles near each other, at most.
MOST_CELLS = 64
# Pairs that are tested at a time.
CHUNK = 1_000_000
# An edge is parallel to a triangle below this share of their lengths; one that meets its border counts as piercing it,
# to this part of its size, for triangles that share no vertex do not touch.
PARALLEL, BORDER = 1e-6, 1e-9


@dataclass(frozen=True, eq=False)
class SurfaceState:
    """A surface without doubles, and its topology."""

    shape: trimesh.Trimesh
    # How many edges have one triangle, and more than two.
    open_edges: int
    crowded_edges: int
    consistent: bool  # whether neighbours agree on which side is outside
    bodies: int  # how many separate surfaces there are

    @classmethod
    def of(cls, shape: trimesh.Trimesh) -> SurfaceState:
        """Merge doubles, in place, and count."""
        shape.merge_vertices(merge_tex=True, merge_norm=True)
        shape.update_faces(shape.nondegenerate_faces())
        shape.update_faces(shape.unique_faces())
        shape.remove_unreferenced_vertices()
        _, counts = np.unique(shape.edges_sorted, axis=0, return_counts=True)
        open_edges, crowded = int((counts == 1).sum()), int((counts > 2).sum())
        consistent = bool(shape.is_winding_consistent)
        return cls(shape, open_edges, crowded, consistent, int(shape.body_count))

    def fault(self) -> str | None:
        """Reason why NETGEN cannot fill it, after "the surface"; None for a closed surface of one part."""
        if len(self.shape.faces) == 0:
            return "has no triangle with an area"
        if self.open_edges:
            return f"is not closed ({self.open_edges} open edges)"
        if self.crowded_edges:
            return f"has {self.crowded_edges} edges that are shared by more than two triangles"
        if not self.consistent:
            return "has triangles that do not agree on which side is outside"
        if self.bodies != 1:
            return f"holds {self.bodies} separate surfaces instead of one"
        if self.shape.volume == 0:
            return "encloses no volume"
        return None

    def doubt(self) -> str | None:
        """Reason why NETGEN may be slow or fail on a closed surface, after "the surface"; None if there is none."""
        if len(self.shape.faces) > MOST_FOR_NETGEN:
            return f"has {len(self.shape.faces):,} triangles"
        # Before the crossings, whose search takes long where thousands of needles meet in one point.
        needles = self._needles()
        if needles:
            return f"has {needles} triangles like needles"
        return None if self.crossing is None else f"intersects itself near {self.crossing} m"

    @cached_property
    def crossing(self) -> str | None:
        """Where the surface intersects itself, if it does."""
        point = first_crossing(self.shape.vertices, self.shape.faces)
        return None if point is None else f"({', '.join(f'{x:.4g}' for x in point)})"

    def _needles(self) -> int:
        corners = np.asarray(self.shape.vertices)[self.shape.faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        height = 2.0 * self.shape.area_faces / longest
        needles, slender = (int((height < share * longest).sum()) for share in (NEEDLE, SLENDER))
        return slender if slender > MOST_SLENDER else needles

    def turn_outward(self, name: str) -> None:
        """Turn a surface that is inside out round, in place, with a warning."""
        if self.shape.volume < 0:
            self.shape.invert()
            warnings.warn(f"{name}: the surface was inside out and has been turned round", MeshWarning, stacklevel=3)


def require_closed(name: str, shape: trimesh.Trimesh, hint: str = BY_HAND) -> SurfaceState:
    """State of a closed surface of one part, its volume positive; MeshError for any other, and why."""
    require_finite(name, shape)
    state = SurfaceState.of(shape)
    fault = state.fault()
    if fault is not None:
        raise MeshError(f"{name}: the surface {fault}; {hint}")
    state.turn_outward(name)
    return state


def require_finite(name: str, shape: trimesh.Trimesh) -> None:
    """Refuse coordinates that are not finite."""
    bad = np.flatnonzero(~np.isfinite(shape.vertices).all(axis=1))
    if bad.size:
        raise MeshError(f"{name}: vertex {bad[0]} has a coordinate that is not finite")


def first_crossing(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray | None:
    """Find a point (3,) where an edge of one triangle passes through another that shares no vertex with it, if any.

    Edges and triangles are tested by T. Moller and B. Trumbore's method (1997), those near each other by a grid.
    """
    for a, b in _near_pairs(vertices[faces]):
        apart = (faces[a][:, :, None] != faces[b][:, None, :]).all(axis=(1, 2))
        for first, second in ((a[apart], b[apart]), (b[apart], a[apart])):
            point = _pierced(vertices[faces[first]], vertices[faces[second]])
            if point is not None:
                return point
    return None


def _pierced(edges_of: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """Point where an edge of the first pierces the second, triangles (k, 3, 3) each."""
    a, span, across = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    for i in range(3):
        start, along = edges_of[:, i], edges_of[:, (i + 1) % 3] - edges_of[:, i]
        p = np.cross(along, across)
        determinant = np.einsum("ij,ij->i", span, p)
        scale = np.linalg.norm(along, axis=1) * np.linalg.norm(span, axis=1) * np.linalg.norm(across, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(np.abs(determinant) > PARALLEL * scale, 1.0 / determinant, np.nan)
        offset = start - a
        q = np.cross(offset, span)
        u, v = inverse * np.einsum("ij,ij->i", offset, p), inverse * np.einsum("ij,ij->i", along, q)
        t = inverse * np.einsum("ij,ij->i", across, q)
        hit = (np.minimum(u, v) > -BORDER) & (u + v < 1 + BORDER) & (np.abs(t - 0.5) < 0.5 + BORDER)
        if hit.any():
            k = int(np.argmax(hit))
            return start[k] + t[k] * along[k]
    return None


def _near_pairs(corners: np.ndarray):
    """Pairs of triangles whose boxes meet a common cell of a grid, in chunks of indices."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    origin, extent = low.min(axis=0), float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    cell = max(2.0 * float(np.median((high - low).max(axis=1))), extent / MOST_CELLS)
    first, last = (np.floor((x - origin) / cell).astype(np.int64) for x in (low, high))
    shape = last - first + 1
    counts = shape.prod(axis=1)
    triangle = np.repeat(np.arange(len(corners)), counts)
    rank = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    ny, nz = shape[triangle, 1], shape[triangle, 2]
    place = first[triangle] + np.column_stack([rank // (ny * nz), rank // nz % ny, rank % nz])
    number = np.ravel_multi_index(tuple(place.T), tuple(last.max(axis=0) + 1))
    order = np.argsort(number, kind="stable")
    triangle, number = triangle[order], number[order]
    start = np.flatnonzero(np.diff(number, prepend=-1))
    size = np.diff(start, append=len(number))
    # Each entry with those after it in its cell.
    after = np.repeat(start + size, size) - np.arange(len(number)) - 1
    begin = 0
    while begin < len(number):
        end = begin + max(1, int(np.searchsorted(np.cumsum(after[begin:]), CHUNK)))
        entry = np.repeat(np.arange(begin, min(end, len(number))), after[begin:end])
        step = np.arange(len(entry)) - np.repeat(np.cumsum(after[begin:end]) - after[begin:end], after[begin:end])
        a, b = triangle[entry], triangle[entry + step + 1]
        meet = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
        yield a[meet], b[meet]
        begin = end
