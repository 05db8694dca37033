"""Paths of tools: random closed ones over the flat top of a block, and along the surface of a curved body.

On a closed path a tool comes, presses, slides, turns, lifts, and is back. The other ones follow a plane's section, with
normals that change evenly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.mesh import TetMesh
from palpate.mesh.triangles import node_area_vectors

# Waves along a path, and the largest rotation of a tool, rad.
WAVES, ROTATION = 3, 0.5
# Angle off the normal from which a place is another one, rad.
ELSEWHERE = 0.6


@dataclass(frozen=True)
class ClosedPaths:
    """Paths that end where they begin, above the surface."""

    # (paths, ticks, tools, 3) m, and (paths, ticks, tools, 4) unit quaternions w x y z.
    positions: np.ndarray
    orientations: np.ndarray

    @classmethod
    def over(
        cls,
        centres: np.ndarray,
        height: float,
        *,
        paths: int,
        ticks: int,
        slide: float,
        depth: tuple[float, float],
        clear: float = 1e-3,
        seed: int = 0,
    ) -> ClosedPaths:
        """Paths around points of a top that faces along z.

        Parameters
        ----------
        centres
            (tools, 3) m, on the top.
        height
            Of a tool's position over its lowest point, m.
        paths, ticks
            How many, and how long each is.
        slide
            Largest distance from the centre along x and y, m.
        depth
            Least and largest depth reached, m.
        clear
            Height over the top at both ends, m.
        seed
            Of the random numbers.

        """
        random = np.random.default_rng(seed)
        tools = len(centres)
        phase = 2 * np.pi * np.linspace(0, 1, ticks)[:, None]

        def closed(components: int) -> np.ndarray:
            """Smooth functions within one in magnitude, (paths, ticks, tools, components), the same at both ends."""
            shape = (paths, 1, tools, components, WAVES)
            size, shift = random.uniform(-1, 1, shape) / WAVES, random.uniform(0, 2 * np.pi, shape)
            angle = (phase * np.arange(1, WAVES + 1))[None, :, None, None, :]
            return (size * np.sin(angle + shift)).sum(axis=-1)

        deepest = random.uniform(*depth, (paths, 1, tools, 1))
        # Down and up once, with presses between that may leave the surface and come back.
        down = np.sin(phase / 2)[None, :, None, :] ** 2
        sunk = down * (clear + deepest) * (1 + 0.4 * closed(1)) - clear
        x = centres + np.concatenate([slide * closed(2), height - sunk], axis=-1)
        return cls(x, _quaternions(ROTATION * closed(3)))

    def holding(self, orientation: tuple[float, float, float, float]) -> ClosedPaths:
        """Return the same paths of tools that have this orientation, w x y z, where these have none."""
        w, v = self.orientations[..., :1], self.orientations[..., 1:]
        first, rest = orientation[0], np.array(orientation[1:])
        scalar = w * first - (v @ rest)[..., None]
        return replace(self, orientations=np.concatenate([scalar, w * rest + first * v + np.cross(v, rest)], axis=-1))

    def script(self) -> tuple[np.ndarray, np.ndarray]:
        """One script of all paths; a tick without tools ends each: (ticks, tools, 3), (ticks, tools, 4)."""
        x = np.full((self.positions.shape[0], self.positions.shape[1] + 1, *self.positions.shape[2:]), np.nan)
        x[:, :-1] = self.positions
        q = np.zeros((*x.shape[:-1], 4))
        q[..., 0] = 1.0
        q[:, :-1] = self.orientations
        return x.reshape(-1, *x.shape[2:]), q.reshape(-1, *q.shape[2:])

    def of_script(self, rows: np.ndarray) -> np.ndarray:
        """Rows (ticks, tools, 3) of what a script returned, by path (paths, ticks, tools, 3)."""
        return rows.reshape(len(self.positions), -1, *rows.shape[1:])[:, :-1]


def _quaternions(rotation: np.ndarray) -> np.ndarray:
    """Return unit quaternions w x y z of rotation vectors (..., 3), rad."""
    angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
    part = np.sinc(angle / (2 * np.pi)) / 2  # sin(angle/2) / angle
    return np.concatenate([np.cos(angle / 2), part * rotation], axis=-1)


@dataclass(frozen=True)
class Curve:
    """Places a step apart on a surface."""

    # (n, 3) m on the flat triangles that the surface is drawn by, and (n, 3) outward, interpolated between the nodes.
    points: np.ndarray
    normals: np.ndarray
    step: float  # m

    def part(self, keep: np.ndarray) -> Curve:
        """Longest run of consecutive places of a mask (n,)."""
        ends = np.flatnonzero(np.diff(np.concatenate([[0], keep.astype(int), [0]])))
        first, last = max(ends.reshape(-1, 2), key=lambda run: run[1] - run[0])
        return Curve(self.points[first:last], self.normals[first:last], self.step)


def section(mesh: TetMesh, origin: np.ndarray, normal: np.ndarray, step: float) -> Curve:
    """Longest closed curve in which a plane cuts the surface of a body, in places a step, m, apart."""
    side = (mesh.nodes - origin) @ normal
    above = side > 0
    ends = np.sort(mesh.surface_triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    crossed = ends[above[ends[..., 0]] != above[ends[..., 1]]]  # two edges of each triangle that is cut, in turn
    edges, joined = np.unique(crossed, axis=0, return_inverse=True)
    part = (side[edges[:, 0]] / (side[edges[:, 0]] - side[edges[:, 1]]))[:, None]

    def on_edges(values: np.ndarray) -> np.ndarray:
        return values[edges[:, 0]] * (1 - part) + values[edges[:, 1]] * part

    points, normals = on_edges(mesh.nodes), on_edges(node_area_vectors(mesh.nodes, mesh.surface_triangles))
    loops = [np.append(loop, loop[0]) for loop in _loops(joined.reshape(-1, 2))]
    lengths = [np.cumsum(np.linalg.norm(np.diff(points[loop], axis=0), axis=1)) for loop in loops]
    longest = int(np.argmax([length[-1] for length in lengths]))
    arc, loop = np.append(0.0, lengths[longest]), loops[longest]
    at = np.arange(0.0, arc[-1], step)
    points, normals = (np.column_stack([np.interp(at, arc, k) for k in rows[loop].T]) for rows in (points, normals))
    return Curve(points, normals / np.linalg.norm(normals, axis=1)[:, None], step)


def _loops(pairs: np.ndarray) -> list[np.ndarray]:
    """Find closed chains of points, each of which occurs in two pairs."""
    order = np.argsort(pairs.ravel(), kind="stable")
    beside = order.reshape(-1, 2)  # the two places in ``pairs`` at which each point stands
    other = pairs.ravel()[order ^ 1].reshape(beside.shape)
    waiting, loops = set(range(len(beside))), []
    while waiting:
        first = min(waiting)
        loop, before, point = [first], first, int(other[first, 0])
        while point != first:
            loop.append(point)
            onwards = other[point, 1] if other[point, 0] == before else other[point, 0]
            before, point = point, int(onwards)
        waiting -= set(loop)
        loops.append(np.array(loop))
    return loops


def away_from_supports(curve: Curve, mesh: TetMesh, fixed: np.ndarray, distance: float) -> np.ndarray:
    """Mask (n,) of places farther from every fixed node than a distance, m."""
    from scipy.spatial import cKDTree

    return cKDTree(mesh.nodes[fixed]).query(curve.points)[0] > distance


def touches_nothing_else(curve: Curve, mesh: TetMesh, radius: float) -> np.ndarray:
    """Mask (n,) of places on which a sphere can stand without touching the body at another place, as in a crease.

    The sphere touches the place from outside; no point of the surface that is seen from its centre by more than
    :data:`ELSEWHERE` off the normal may lie within it.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(_dense(mesh))
    centres = curve.points + radius * curve.normals
    free = np.ones(len(centres), dtype=bool)
    for k, (centre, near) in enumerate(zip(centres, tree.query_ball_point(centres, radius), strict=True)):
        offset = tree.data[near] - centre
        aside = -offset @ curve.normals[k] < np.cos(ELSEWHERE) * np.linalg.norm(offset, axis=1)
        free[k] = not aside.any()
    return free


def _dense(mesh: TetMesh) -> np.ndarray:
    """Points (n, 3), m, all over the drawn surface: a lattice of eight to an edge on each triangle."""
    i, j = np.array([(i, j) for i in range(9) for j in range(9 - i)]).T / 8
    lattice = np.column_stack([i, j, 1 - i - j])
    return np.einsum("qk,tkx->tqx", lattice, mesh.nodes[mesh.surface_triangles]).reshape(-1, 3)
