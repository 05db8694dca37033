"""Surface nodes of tetrahedra moved onto a surface, as far as no element becomes bad."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.mesh.elements import smallest_dihedral_angles
from palpate.mesh.tetmesh import TetMesh

# Elements may become as flat as this, degrees; one that is flatter already keeps this part of its angle.
LEAST_ANGLE, KEPT_ANGLE = 7.0, 0.85
# A node in a bad element goes back by this factor; below this part of the mean edge it does not move.
BACK, LEAST_MOVE = 0.7, 1e-3
# Nodes that went back are tried again from where they are.
ROUNDS = 3


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
