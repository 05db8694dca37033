"""Curved 10-node meshes with smaller elements around a place, and the same surface to the last bit of its shape."""

from __future__ import annotations

import logging

import numpy as np
from scipy.spatial import cKDTree

import palpate
from palpate.mesh.elements import EDGES, corner_volumes
from palpate.mesh.shape_functions import values

# Elements in which a point is looked for, by the distance of their middles.
CANDIDATES = 60
# How fast the longest edge grows with the distance.
GROWTH = 0.9


def refined(mesh: palpate.TetMesh, place: np.ndarray, edge: float, within: float) -> palpate.TetMesh:
    """Divide elements until none within a distance of a place is longer than an edge, m, and those beyond it not much.

    The length of an element is the edge of the regular tetrahedron with its volume, and its distance that of the
    nearest corner.

    scikit-fem divides the elements with straight edges. Each new node has then its place in an element of the mesh as
    given, whose shape functions carry it onto the curved one: quadratic in the parent is quadratic in its parts.
    """
    import skfem

    # It says that it copies its arrays.
    logging.getLogger("skfem").setLevel(logging.ERROR)
    corners, ranks = np.unique(mesh.tets[:, :4], return_inverse=True)
    divided = skfem.MeshTet(mesh.nodes[corners].T.copy(), ranks.reshape(-1, 4).T.copy())
    while True:
        nodes, tets = divided.p.T, divided.t.T
        length = np.cbrt(6.0 * np.sqrt(2.0) * np.abs(corner_volumes(nodes, tets)))
        distance = np.linalg.norm(nodes - place, axis=1)[tets].min(axis=1)
        too_long = np.flatnonzero(length > edge + GROWTH * np.maximum(0.0, distance - within))
        if len(too_long) == 0:
            break
        divided = divided.refined(too_long)
    straight = palpate.TetMesh(divided.p.T, divided.t.T).to_quadratic()
    return palpate.TetMesh(_curved(mesh, straight.nodes), straight.tets)


def _curved(mesh: palpate.TetMesh, points: np.ndarray) -> np.ndarray:
    """Return where points (n, 3) of the elements with straight edges lie in the curved ones, m."""
    corners = mesh.nodes[mesh.tets[:, :4]]
    to_barycentric = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    _, candidates = cKDTree(corners.mean(axis=1)).query(points, k=min(CANDIDATES, len(corners)))
    offsets = points[:, None] - corners[candidates, 0]
    others = np.einsum("ncij,ncj->nci", to_barycentric[candidates], offsets)
    barycentric = np.concatenate([1.0 - others.sum(axis=2, keepdims=True), others], axis=2)
    chosen = barycentric.min(axis=2).argmax(axis=1)
    rows = np.arange(len(points))
    at = barycentric[rows, chosen]
    assert at.min() > -1e-9, "a point outside of the elements that are near it"
    return np.einsum("na,nai->ni", values(at, 10, EDGES), mesh.nodes[mesh.tets[candidates[rows, chosen]]])
