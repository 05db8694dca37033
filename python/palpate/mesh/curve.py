"""Straight 10-node tetrahedra bent onto a surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate import _native
from palpate.mesh.elements import unique_edges
from palpate.mesh.tetmesh import TetMesh

# A curved element's least determinant in parts of its largest, in which straight ones have 1.
LEAST_DETERMINANT = 0.2
# Farthest that a mid-side node is moved, in parts of its edge; by less than this part of the mean edge it stays.
MOST_BULGE, LEAST_BULGE = 0.2, 1e-3


def curve(mesh: TetMesh, project: Callable[[np.ndarray], np.ndarray]) -> TetMesh:
    """10-node tetrahedra, the middles of surface edges on a shape, or as near as folds no element.

    Parameters
    ----------
    mesh
        4-node tetrahedra.
    project
        Points (p, 3), m, onto the shape.

    """
    edges, of_element = unique_edges(mesh.tets)
    straight = mesh.nodes[edges].mean(axis=1)
    ends = np.sort(mesh.surface_triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    outside = np.isin(edges @ [len(mesh.nodes), 1], ends @ [len(mesh.nodes), 1])
    lengths = np.linalg.norm(np.diff(mesh.nodes[edges[outside]], axis=1)[:, 0], axis=1)
    bulge = np.zeros_like(straight)
    bulge[outside] = project(straight[outside]) - straight[outside]
    size = np.maximum(np.linalg.norm(bulge[outside], axis=1), np.finfo(float).tiny)
    bulge[outside] *= np.minimum(1, MOST_BULGE * lengths / size)[:, None]
    tets = np.hstack([mesh.tets, len(mesh.nodes) + of_element])
    least = LEAST_BULGE * lengths.mean()
    while True:
        nodes = np.vstack([mesh.nodes, straight + bulge])
        low, high = _native.determinant_ranges(nodes, tets.astype(np.uint32)).reshape(-1, 2).T
        bad = np.unique(of_element[low < LEAST_DETERMINANT * high])
        if not bulge[bad].any():
            return TetMesh(nodes, tets, mesh.regions, mesh.region_names)
        bulge[bad] = np.where(np.linalg.norm(bulge[bad], axis=1) > least, 0.7, 0.0)[:, None] * bulge[bad]
