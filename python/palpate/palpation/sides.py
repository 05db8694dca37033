"""Sides of a body: parts of its surface between sharp edges, and points about equally far apart on them.

A flat side gets a square lattice, as wide apart as asked, in the middle of the side. A curved side gets as many points
as a hexagonal packing of that distance has, `A / (sqrt(3)/2 s^2)`, first each as far as possible from those before
(Gonzalez 1985), then moved to the middle of what is closest to it (Lloyd 1982). Distances are those of places together
with normals, so that both faces of a thin part are far apart. The same body gives the same points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.errors import SceneError
from palpate.green import GreensFunction
from palpate.mesh.triangles import area_vectors, units

# Faces that meet at a larger angle are two sides, rad; a side whose faces are turned less from their mean is flat.
SHARP, FLAT = np.radians(45.0), np.radians(1.0)
# More points than these are a slip of the pen: an hour of ticks, and a picture of dots.
MOST_POINTS = 5000
# Candidates on a curved side lie so many times closer than its points; steps of Lloyd's algorithm.
FINER, LLOYD_STEPS = 6, 15


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


@dataclass(frozen=True)
class Samples:
    """Points on flat triangles: places (p, 3) m, and ranks (p,) of the triangles."""

    points: np.ndarray
    triangles: np.ndarray


def lattice_on(side: Side, spacing: float) -> Samples:
    """Square lattice on a flat side, its axes along those of the body as far as they lie in it."""
    from matplotlib.tri import Triangulation

    first, second = side.axes()
    nodes, triangles = np.unique(side.triangles, return_inverse=True)
    u, v = (side.positions[nodes] @ axis for axis in (first, second))
    columns, rows = (_centred(axis.min(), axis.max(), spacing) for axis in (u, v))
    if len(columns) * len(rows) > 4 * MOST_POINTS:
        raise too_many(len(columns) * len(rows), spacing)
    x, y = (axis.ravel() for axis in np.meshgrid(columns, rows))
    find = Triangulation(u, v, triangles.reshape(-1, 3)).get_trifinder()
    ranks = find(x, y)
    x, y, ranks = x[ranks >= 0], y[ranks >= 0], ranks[ranks >= 0]
    up = side.normals[0]
    height = side.positions[side.triangles[ranks, 0]] @ up
    return Samples(x[:, None] * first + y[:, None] * second + height[:, None] * up, side.ranks[ranks])


def evenly_on(side: Side, spacing: float) -> Samples:
    """Points about equally far apart on a curved side."""
    wanted = max(1, round(side.area / (np.sqrt(3) / 2 * spacing**2)))
    if wanted > MOST_POINTS:
        raise too_many(wanted, spacing)
    points, ranks, areas = _candidates(side, spacing / FINER)
    places = np.hstack([points, spacing * side.normals[ranks]])
    chosen = _farthest(places, min(wanted, len(places)))
    chosen = _lloyd(places, areas, chosen)
    return Samples(points[chosen], side.ranks[ranks[chosen]])


def too_many(count: int, spacing: float) -> SceneError:
    """Error of a spacing that is far too small."""
    return SceneError(
        f"a grid of {1e3 * spacing:.3g} mm has {count} points here, more than {MOST_POINTS}: give a wider one "
        "or a part of it"
    )


def _centred(low: float, high: float, spacing: float) -> np.ndarray:
    """As many coordinates as fit, a spacing apart, as far from one end as from the other."""
    count = max(1, int((high - low) / spacing * (1 + 1e-9)))
    return (low + high) / 2 + spacing * (np.arange(count) - (count - 1) / 2)


def _candidates(side: Side, apart: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles (c, 3) of equal parts of the triangles, their triangles (c,) by rank in the side, and areas (c,), m^2."""
    corners = side.positions[side.triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(1, np.ceil(longest / apart)).astype(int)
    found = []
    for count in np.unique(parts):
        i, j = np.array([(i, j) for i in range(count) for j in range(count - i)]).T
        upright = np.column_stack([i + 1 / 3, j + 1 / 3])
        turned = np.column_stack([i + 2 / 3, j + 2 / 3])[i + j < count - 1]
        inside = np.vstack([upright, turned]) / count
        weights = np.column_stack([inside, 1 - inside.sum(axis=1)])
        ranks = np.flatnonzero(parts == count)
        points = np.einsum("qk,tkx->tqx", weights, corners[ranks]).reshape(-1, 3)
        found.append((points, np.repeat(ranks, count**2), np.repeat(side.areas[ranks] / count**2, count**2)))
    points, ranks, areas = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(ranks, kind="stable")
    return points[order], ranks[order], areas[order]


def _farthest(places: np.ndarray, count: int) -> np.ndarray:
    """Ranks (count,) of places, each as far as possible from those before, the first closest to their middle."""
    chosen = [int(np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=1)))]
    distance = np.full(len(places), np.inf)
    while len(chosen) < count:
        np.minimum(distance, ((places - places[chosen[-1]]) ** 2).sum(axis=1), out=distance)
        chosen.append(int(distance.argmax()))
    return np.array(chosen)


def _lloyd(places: np.ndarray, weights: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Ranks of the places in the middle of what is closest to each."""
    from scipy.spatial import cKDTree

    for _ in range(LLOYD_STEPS):
        closest = cKDTree(places[chosen]).query(places)[1]
        total = np.bincount(closest, weights, len(chosen))
        middles = np.column_stack([np.bincount(closest, weights * axis, len(chosen)) for axis in places.T])
        # What nothing is closest to stays where it is.
        middles = np.where(total[:, None] > 0, middles / np.maximum(total, 1e-300)[:, None], places[chosen])
        chosen = np.unique(cKDTree(places).query(middles)[1])
    return chosen
