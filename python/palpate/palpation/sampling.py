"""Sampling of a body's surface: points about equally far apart, at which a protocol presses.

The surface is cut into sides along its sharp edges. A flat side gets a square lattice, as wide apart as asked, in the
middle of the side. A curved side gets as many points as a hexagonal packing of that distance has,
`A / (sqrt(3)/2 s^2)`, first each as far as possible from those before (Gonzalez 1985), then moved to the middle of what
is closest to it (Lloyd 1982). Distances are those of places together with normals, so that both faces of a thin part
are told apart. The same body gives the same points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.errors import SceneError
from palpate.palpation.sides import Side

# More points than these are a slip of the pen: an hour of ticks, and a picture of dots.
MOST_POINTS = 5000
# Candidates on a curved side lie so many times closer than its points; steps of Lloyd's algorithm.
FINER, LLOYD_STEPS = 6, 15


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
