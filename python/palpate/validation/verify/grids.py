"""Structured tetrahedral meshes of boxes and of whatever a box can be mapped to.

A cell of the lattice is cut into six tetrahedra along its diagonal (Kuhn, 1960): neighbours agree on every face without
being asked. Where a map collapses an edge of cells to a point, as polar coordinates do at their axis, the points become
one node and the tetrahedra that lost their volume are left out; what remains still fits together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from palpate.mesh import TetMesh
from palpate.mesh.elements import kuhn_tets, unique_edges

# Points closer than this part of the body's size are one node.
SAME = 1e-9

Place = Callable[[np.ndarray], np.ndarray]


def box(cells: Sequence[int], size: Sequence[float], *, quadratic: bool) -> TetMesh:
    """Box from the origin to ``size``, m, of equal cells."""
    axes = [np.linspace(0, length, count + 1) for length, count in zip(size, cells, strict=True)]
    return mapped(lattice(*axes), quadratic=quadratic)


def lattice(*axes: np.ndarray) -> np.ndarray:
    """Coordinates of all combinations, (a, b, c, 3)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def mapped(coordinates: np.ndarray, place: Place = np.asarray, *, quadratic: bool) -> TetMesh:
    """Mesh of a mapped lattice.

    Parameters
    ----------
    coordinates
        (a, b, c, 3) curvilinear coordinates of the lattice.
    place
        Positions (n, 3), m, at coordinates (n, 3).
    quadratic
        10-node tetrahedra. The middle of an edge is placed at the mean of its ends' coordinates: on the true geometry
        where ``place`` is curved.

    """
    given = coordinates.reshape(-1, 3)
    points = place(given)
    grid = np.round(points / (SAME * np.ptp(points, axis=0).max())).astype(np.int64)
    _, first, node = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    node = node.ravel()
    tets = node[kuhn_tets(coordinates.shape[:3])]
    whole = (np.diff(np.sort(tets, axis=1), axis=1) > 0).all(axis=1)
    nodes, tets = points[first], tets[whole]
    if not quadratic:
        return TetMesh(nodes, tets)
    edges, of_element = unique_edges(tets)
    middles = place(_means(_with_gaps(given, first, node), edges))
    return TetMesh(np.vstack([nodes, middles]), np.hstack([tets, len(nodes) + of_element]))


def cylindrical(coordinates: np.ndarray) -> np.ndarray:
    """Positions at (radius, angle about z, z)."""
    r, angle, z = coordinates.T
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def spherical(coordinates: np.ndarray) -> np.ndarray:
    """Positions at (radius, angle from z, angle about z)."""
    r, polar, angle = coordinates.T
    across = r * np.sin(polar)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), r * np.cos(polar)])


def jittered(mesh: TetMesh, part: float, seed: int) -> TetMesh:
    """Move inner nodes of a 4-node mesh at random by up to ``part`` of its shortest edge along each axis."""
    edges, _ = unique_edges(mesh.tets)
    shortest = np.linalg.norm(np.diff(mesh.nodes[edges], axis=1), axis=2).min()
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.surface_nodes)
    nodes = mesh.nodes.copy()
    nodes[inside] += part * shortest * np.random.default_rng(seed).uniform(-1, 1, (len(inside), 3))
    return TetMesh(nodes, mesh.tets)


def _with_gaps(given: np.ndarray, first: np.ndarray, node: np.ndarray) -> np.ndarray:
    """Coordinates of the nodes; NaN where points that became one node differ: the coordinate has no value there."""
    lowest, highest = np.full((len(first), 3), np.inf), np.full((len(first), 3), -np.inf)
    np.minimum.at(lowest, node, given)
    np.maximum.at(highest, node, given)
    return np.where(highest - lowest > SAME, np.nan, given[first])


def _means(coordinates: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Mean coordinates of both ends; one that has no value at an end follows the other end."""
    a, b = coordinates[edges[:, 0]], coordinates[edges[:, 1]]
    a, b = np.where(np.isnan(a), b, a), np.where(np.isnan(b), a, b)
    return np.nan_to_num((a + b) / 2)
