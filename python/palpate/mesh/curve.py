"""Tetrahedra on a surface: its nodes put back on it, edges with a middle there, or eight small ones for each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate import _native
from palpate.mesh.elements import (
    AT_CORNERS,
    DIAGONALS,
    EDGES,
    INSIDE,
    corner_volumes,
    smallest_dihedral_angles,
    unique_edges,
)
from palpate.mesh.tetmesh import TetMesh

# A curved element's least determinant in parts of its largest, in which straight ones have 1.
LEAST_DETERMINANT = 0.2
# Farthest that a mid-side node is moved, in parts of its edge; by less than this part of the mean edge it stays.
MOST_BULGE, LEAST_BULGE = 0.2, 1e-3
# An eighth of an element keeps this part of the shape that it has in the straight one, unless it is as good as this (a
# regular tetrahedron has 1, one of a cube cut into six 0.7).
KEPT_SHAPE, GOOD_SHAPE = 0.7, 0.5


Projection = Callable[[np.ndarray], np.ndarray]
# Elements may become as flat as this, degrees; one that is flatter already keeps this part of its angle.
LEAST_ANGLE, KEPT_ANGLE = 7.0, 0.85
# A node in a bad element goes back by this factor; below this part of the mean edge it does not move.
BACK, LEAST_MOVE = 0.7, 1e-3
# Nodes that went back are tried again from where they are.
ROUNDS = 3


def curve(mesh: TetMesh, project: Projection, inner: tuple[np.ndarray, Projection] | None = None) -> TetMesh:
    """10-node tetrahedra, the middles of surface edges on a shape, or as near as folds no element.

    ``project`` takes points (p, 3), m, onto the shape. ``inner`` are faces (k, 3) within the body, and the projection
    of the middles of their edges, if there are any.
    """

    def folded(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
        low, high = _native.determinant_ranges(nodes, tets.astype(np.uint32)).reshape(-1, 2).T
        return low < LEAST_DETERMINANT * high

    nodes, tets = _curve_edges(mesh, project, folded, inner)
    return TetMesh(nodes, tets, mesh.regions, mesh.region_names)


def refine(mesh: TetMesh, project: Callable[[np.ndarray], np.ndarray]) -> TetMesh:
    """Eight 4-node tetrahedra for each of a mesh, new surface nodes on a shape, or as near as flattens no element.

    A tetrahedron is cut at the middles of its edges. The octahedron that is left inside is cut along its shortest
    diagonal (Bey 1995; Zhang 1995). However often that is done, angles do not go to zero. ``project`` takes points (p,
    3), m, onto the shape.
    """

    def flattened(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
        parts = _subelements(nodes, tets).reshape(-1, 4)
        straight = nodes.copy()
        straight[tets[:, 4:]] = nodes[tets[:, EDGES]].mean(axis=2)
        bent, before = (_shapes(points, parts).reshape(-1, 8) for points in (nodes, straight))
        return (bent < np.minimum(GOOD_SHAPE, KEPT_SHAPE * before)).any(axis=1)

    nodes, tets = _curve_edges(mesh, project, flattened)
    parts = _subelements(nodes, tets).reshape(-1, 4)
    return TetMesh(nodes, parts, np.repeat(mesh.regions, 8), mesh.region_names)


def _curve_edges(
    mesh: TetMesh,
    project: Projection,
    is_bad: Callable[[np.ndarray, np.ndarray], np.ndarray],
    inner: tuple[np.ndarray, Projection] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3), m, and elements (m, 10) with middles of surface edges moved as far as leaves no element bad.

    ``is_bad`` gets nodes and elements and returns a mask of the elements.
    """
    edges, of_element = unique_edges(mesh.tets)
    straight = mesh.nodes[edges].mean(axis=1)
    on_shape = outside = _edges_of(mesh, edges, mesh.surface_triangles)
    bulge = np.zeros_like(straight)
    bulge[outside] = project(straight[outside]) - straight[outside]
    if inner is not None:
        within = _edges_of(mesh, edges, inner[0]) & ~outside
        bulge[within] = inner[1](straight[within]) - straight[within]
        on_shape = outside | within
    lengths = np.linalg.norm(np.diff(mesh.nodes[edges[on_shape]], axis=1)[:, 0], axis=1)
    size = np.maximum(np.linalg.norm(bulge[on_shape], axis=1), np.finfo(float).tiny)
    bulge[on_shape] *= np.minimum(1, MOST_BULGE * lengths / size)[:, None]
    tets = np.hstack([mesh.tets, len(mesh.nodes) + of_element])
    # Only these can be bad.
    moved = np.flatnonzero(bulge.any(axis=1)[of_element].any(axis=1))
    least = LEAST_BULGE * lengths.mean()
    while True:
        nodes = np.vstack([mesh.nodes, straight + bulge])
        bad = np.unique(of_element[moved[is_bad(nodes, tets[moved])]])
        if not bulge[bad].any():
            return nodes, tets
        bulge[bad] = np.where(np.linalg.norm(bulge[bad], axis=1) > least, 0.7, 0.0)[:, None] * bulge[bad]


def _edges_of(mesh: TetMesh, edges: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Mask of the edges (e, 2) that belong to triangles (k, 3)."""
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    return np.isin(edges @ [len(mesh.nodes), 1], ends @ [len(mesh.nodes), 1])


def _subelements(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Parts (m, 8, 4) of elements (m, 10), oriented as these."""
    middles = nodes[tets[:, 4:]]
    diagonals = np.stack([np.linalg.norm(middles[:, i] - middles[:, j], axis=1) for i, j in DIAGONALS], axis=1)
    inside = INSIDE[diagonals.argmin(axis=1)]
    rows = np.arange(len(tets))[:, None, None]
    return np.concatenate([tets[:, AT_CORNERS], tets[rows, inside]], axis=1)


def _shapes(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Mean ratios (m,): 1 for a regular tetrahedron, 0 for a flat one, negative where inverted (Liu and Joe 1994)."""
    corners = nodes[tets]
    volumes = corner_volumes(nodes, tets)
    edges = corners[:, EDGES[:, 0]] - corners[:, EDGES[:, 1]]
    return np.sign(volumes) * 12 * np.cbrt(9 * volumes**2) / np.einsum("eij,eij->e", edges, edges)


def snap(mesh: TetMesh, project: Callable[[np.ndarray], np.ndarray], moving: np.ndarray | None = None) -> TetMesh:
    """4-node tetrahedra with their surface nodes on a shape, or as near as keeps every element's dihedral angles.

    ``project`` takes points (p, 3), m, onto the shape; one that has no place there stays. The nodes ``moving`` (k,) are
    moved; None: those on the surface.
    """
    nodes, tets, moving = mesh.nodes.copy(), mesh.tets, mesh.surface_nodes if moving is None else moving
    least = LEAST_MOVE * np.linalg.norm(nodes[tets[:, 0]] - nodes[tets[:, 1]], axis=1).mean()
    for _ in range(ROUNDS):
        move = np.zeros_like(nodes)
        move[moving] = project(nodes[moving]) - nodes[moving]
        nodes += _allowed(nodes, tets, move, least)
    return TetMesh(nodes, tets, mesh.regions, mesh.region_names)


def _allowed(nodes: np.ndarray, tets: np.ndarray, move: np.ndarray, least: float) -> np.ndarray:
    """Shorten moves (n, 3) where elements would become bad."""
    touched = np.flatnonzero(move.any(axis=1)[tets].any(axis=1))
    floor = np.minimum(LEAST_ANGLE, KEPT_ANGLE * smallest_dihedral_angles(nodes, tets[touched]))
    while True:
        bad = np.unique(tets[touched[smallest_dihedral_angles(nodes + move, tets[touched]) < floor]])
        if not move[bad].any():
            return move
        shorter = np.linalg.norm(move[bad], axis=1) > least
        move[bad] *= np.where(shorter, BACK, 0.0)[:, None]
