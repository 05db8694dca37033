"""Curved 10-node meshes with smaller elements around a place, and the same surface to the last bit of its shape."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

import palpate
from palpate.mesh.elements import EDGES
from palpate.mesh.shape_functions import values

# Elements in which a point is looked for, by the distance of their middles.
CANDIDATES = 60


def refined(mesh: palpate.TetMesh, place: np.ndarray, longest: Callable[[np.ndarray], np.ndarray]) -> palpate.TetMesh:
    """Divide elements until none is longer than it may be at its distance from a place, m.

    ``longest`` gives edges (m,), m, at distances (m,) of the nearest corners. The length of an element is the edge of
    the regular tetrahedron with its volume.

    scikit-fem divides the elements with straight edges. Each new node has then its place in an element of the mesh as
    given, whose shape functions carry it onto the curved one: quadratic in the parent is quadratic in its parts.
    """
    import skfem

    # It says that it copies its arrays.
    logging.getLogger("skfem").setLevel(logging.ERROR)
    corners, ranks = np.unique(mesh.tets[:, :4], return_inverse=True)
    divided = skfem.MeshTet(mesh.nodes[corners].T.copy(), ranks.reshape(-1, 4).T.copy())
    while True:
        a, b, c, d = (divided.p[:, corner].T for corner in divided.t)
        length = np.cbrt(np.sqrt(2.0) * np.abs(np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a)))
        distance = np.min([np.linalg.norm(corner - place, axis=1) for corner in (a, b, c, d)], axis=0)
        too_long = np.flatnonzero(length > longest(distance))
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
