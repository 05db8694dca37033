"""Sides of a body: parts of its surface between sharp edges, and distances from edges and supports."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.green import GreensFunction
from palpate.mesh.triangles import area_vectors, units

# Faces that meet at a larger angle are two sides, rad; a side whose faces are turned less from their mean is flat.
SHARP, FLAT = np.radians(45.0), np.radians(1.0)


@dataclass(frozen=True)
class Side:
    """Part of a surface without sharp edges."""

    positions: np.ndarray  # (s, 3) m, of all nodes of the surface, as the body's own loads have put them
    # (t, 3) rows of ``positions``, outward; which triangles of the surface these are (t,).
    triangles: np.ndarray
    ranks: np.ndarray
    # (t, 3) outward, and (t,) m^2.
    normals: np.ndarray
    areas: np.ndarray

    @property
    def area(self) -> float:
        """All of it, m^2."""
        return float(self.areas.sum())

    @property
    def is_flat(self) -> bool:
        """Whether all of it lies in one plane."""
        mean = self.areas @ self.normals
        return bool((self.normals @ (mean / np.linalg.norm(mean))).min() > np.cos(FLAT))

    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions (3,): in a flat side along x of the body, or y where it faces x; else of most extent."""
        if not self.is_flat:
            middles = self.positions[self.triangles].mean(axis=1)
            offset = middles - self.areas @ middles / self.area
            _, vectors = np.linalg.eigh((offset * self.areas[:, None]).T @ offset)
            longest, second = vectors[:, 2], vectors[:, 1]
            # An eigenvector has no sign of its own.
            return tuple(axis * np.sign(axis[np.abs(axis).argmax()]) for axis in (longest, second))
        return plane_axes(self.normals[0])


def plane_axes(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions (3,) in the plane that faces ``up``: along x, or y where it faces x, and across."""
    along = np.eye(3)[0 if abs(up[0]) < 0.9 else 1]
    first = along - (along @ up) * up
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def distances_to_lines(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distances (k, n), m, of points (k, 3) from straight lines between ends (n, 3)."""
    along = end - start
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / squared, 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * along, axis=2)


class SurfaceShape:
    """The surface of a body under its own loads, in its own frame."""

    def __init__(self, green: GreensFunction):
        self.positions = green.surface_positions + green.free_displacements
        self.triangles = green.surface_corners
        self.fixed = np.isin(green.surface_nodes, green.fixed_nodes)
        self.touchable = np.isin(green.surface_nodes, green.touchable_nodes)
        along = area_vectors(self.positions[self.triangles])
        self.areas, self.normals = np.linalg.norm(along, axis=1), units(along)

    @property
    def extents(self) -> np.ndarray:
        """Sides of the box around it, (3,) m."""
        return np.ptp(self.positions, axis=0)

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges (e, 2) that two triangles share, and the ranks of these (e, 2)."""
        ends = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        order = np.lexsort(ends.T[::-1])
        same = (ends[order[1:]] == ends[order[:-1]]).all(axis=1)
        first, second = order[:-1][same], order[1:][same]
        return ends[first], np.column_stack([first, second]) // 3

    @cached_property
    def _sharp(self) -> np.ndarray:
        """Mask (e,) of the edges at which the surface turns by more than :data:`SHARP`."""
        between = self._edges[1]
        return np.einsum("ij,ij->i", *self.normals[between].swapaxes(0, 1)) < np.cos(SHARP)

    @cached_property
    def sides(self) -> list[Side]:
        """Parts of the surface between sharp edges, in the order of their first triangles."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        joined = self._edges[1][~self._sharp]
        count = len(self.triangles)
        graph = coo_array((np.ones(len(joined)), joined.T), shape=(count, count))
        parts = connected_components(graph, directed=False)[1]
        members = (np.flatnonzero(parts == part) for part in range(parts.max() + 1))
        return [
            Side(self.positions, self.triangles[ranks], ranks, self.normals[ranks], self.areas[ranks])
            for ranks in members
        ]

    def by_an_edge(self, points: np.ndarray, distance: float) -> np.ndarray:
        """Mask (p,) of points (p, 3), m, within a distance, m, of a sharp edge."""
        return self._near(self._edges[0][self._sharp], points, distance)

    def by_a_support(self, points: np.ndarray, triangles: np.ndarray, distance: float) -> np.ndarray:
        """Mask (p,) of points (p, 3), m, on triangles (p,) that are fixed or within a distance, m, of what is."""
        edges = self._edges[0]
        held = self.fixed[self.triangles[triangles]].all(axis=1)
        alone = np.flatnonzero(self.fixed)
        ends = np.vstack([edges[self.fixed[edges].all(axis=1)], np.column_stack([alone, alone])])
        return held | self._near(ends, points, distance)

    def may_be_touched(self, triangles: np.ndarray) -> np.ndarray:
        """Mask (p,) of triangles (p,) whose nodes may all be touched."""
        return self.touchable[self.triangles[triangles]].all(axis=1)

    def _near(self, edges: np.ndarray, points: np.ndarray, distance: float) -> np.ndarray:
        """Mask (p,) of points (p, 3) within a distance of straight lines between nodes (e, 2)."""
        from scipy.spatial import cKDTree

        if len(edges) == 0 or len(points) == 0:
            return np.zeros(len(points), dtype=bool)
        start, end = self.positions[edges[:, 0]], self.positions[edges[:, 1]]
        length = np.linalg.norm(end - start, axis=1)
        # Every place of a line is within half its length of its middle: what is near none of these is left out.
        near = cKDTree((start + end) / 2).query_ball_point(points, distance + length.max() / 2)
        mask = np.zeros(len(points), dtype=bool)
        for rank, lines in enumerate(near):
            if lines:
                mask[rank] = distances_to_lines(points[rank, None], start[lines], end[lines]).min() < distance
        return mask
