"""The contact problem solved directly: a rigid tool without friction pressed into the top of a body, by Signorini.

With pressure `p = sum_j p_j phi_j`, phi_j the linear hat of a node on the flat triangles of the faces, N_i the shape
functions of the element, and `M_ij = int N_i phi_j dA`, the nodal forces are `M p` and the top sinks by `Psi M p`. The
tool at depth d over the gap g may nowhere, in the mean under a hat, lie below the surface:

    A = M^T Psi M,   w = A p - (d m - G) >= 0,   p >= 0,   p . w = 0,   m_j = int phi_j dA,   G_j = int phi_j g dA,

a linear complementarity problem with a symmetric positive definite matrix, so `p` is the minimum of
`p.A p/2 - p.(d m - G)` over `p >= 0`: non-negative least squares with the Cholesky factor of A (Lawson and Hanson
1974). Hats instead of nodes, since the consistent nodal forces of a uniform pressure vanish at the corners of a 6-node
face: their sign says nothing.

Nothing of the force loop is used, and the contact is resolved by elements much smaller than it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.optimize import nnls

from palpate.green import GreensFunction
from palpate.mesh import TetMesh
from palpate.mesh.elements import FACE_TRIANGLES
from palpate.mesh.shape_functions import TRIANGLE_EDGES, TRIANGLE_NODES, TRIANGLE_POINTS, TRIANGLE_WEIGHTS, values
from palpate.validation.verify.contact.tools import Gap


@dataclass(frozen=True)
class Press:
    """A tool at rest in the body."""

    # m, N.
    depth: float
    force: float
    area: float  # of all hats that carry pressure, m^2
    pressures: np.ndarray  # (n,) Pa, at the nodes


@dataclass(frozen=True)
class ContactProblem:
    """Compliance of a part of a body's flat top, for hats of pressure on it."""

    places: np.ndarray  # (n, 2) m, of the nodes
    areas: np.ndarray  # (n,) m^2, integrals of the hats
    compliance: np.ndarray  # (n, n) `M^T Psi M`, m^3/Pa
    quadrature: tuple[np.ndarray, np.ndarray]  # places (q, 2), hats of the nodes there (q, n) times area

    @classmethod
    def on_top(cls, green: GreensFunction, mesh: TetMesh) -> ContactProblem:
        """Of the faces on the top whose nodes may all be touched."""
        up = np.array([0.0, 0.0, 1.0])
        faces = faces_on(green, mesh, mesh.nodes[mesh.nodes[:, 2].argmax()], up)
        return cls.on(faces, mesh.nodes[:, :2], lambda nodes: compliance_along(green, nodes, up))

    @classmethod
    def on(cls, faces: np.ndarray, plane: np.ndarray, compliance: Callable[[np.ndarray], np.ndarray]) -> ContactProblem:
        """Of faces (k, 3 or 6) of a plane: places (nodes of the mesh, 2), m, in it, and `Psi` across it."""
        nodes, corners = np.unique(faces, return_inverse=True)
        load, (places, hats) = _integrals(plane[nodes], corners.reshape(faces.shape))
        return cls(plane[nodes], hats.sum(axis=0), load.T @ compliance(nodes) @ load, (places, hats))

    def press(self, gap: Gap, depths: Sequence[float]) -> list[Press]:
        """Press the tool to each depth of its lowest point below the untouched top, m."""
        places, hats = self.quadrature
        # Far outside of the tool no pressure acts; a large height keeps the numbers finite.
        height = np.minimum(gap(places), 1e3 * max(depths))
        gaps = hats.T @ height
        scale = 1 / np.sqrt(np.diag(self.compliance))
        factor = scipy.linalg.cholesky(scale[:, None] * self.compliance * scale, lower=True)
        found = []
        for depth in depths:
            right = scale * (depth * self.areas - gaps)
            pressures = (
                scale * nnls(factor.T, scipy.linalg.solve_triangular(factor, right, lower=True), maxiter=5000)[0]
            )
            area = float(self.areas[pressures > 0].sum())
            found.append(Press(depth, float(self.areas @ pressures), area, pressures))
        return found


def faces_on(green: GreensFunction, mesh: TetMesh, origin: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Faces on a plane whose nodes may all be touched, (k, 3 or 6)."""
    off = np.abs((mesh.nodes - origin) @ normal) > 1e-9 * np.ptp(mesh.nodes, axis=0).max()
    faces = mesh.surface_faces[~off[mesh.surface_faces].any(axis=1)]
    return faces[np.isin(faces, green.touchable_nodes).all(axis=1)]


def compliance_along(green: GreensFunction, nodes: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """`Psi` along a direction (3,) between nodes (n, n), m/N."""
    rows, force = np.searchsorted(green.surface_nodes, nodes), tuple(direction)
    return np.array([green.solve(forces={int(node): force}).displacements[rows] @ direction for node in nodes])


def triangle_areas(corners: np.ndarray) -> np.ndarray:
    """Areas (f,), m^2, of triangles of the plane (f, 3, 2)."""
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.abs(a * d - b * c) / 2


def _integrals(places: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """`M` (n, n), and quadrature points (q, 2) with hats times area (q, n), on straight-edged faces of a plane."""
    width = faces.shape[1]
    load = np.zeros((len(places),) * 2)
    points, hats = [], []
    corners = places[faces[:, :3]]
    areas = triangle_areas(corners)
    parts = FACE_TRIANGLES[width]
    for part in parts:
        barycentric = TRIANGLE_POINTS @ TRIANGLE_NODES[part]
        shapes = values(barycentric, width, TRIANGLE_EDGES)
        share = areas / len(parts)
        for q, hat in enumerate(TRIANGLE_POINTS):
            points.append(np.einsum("k,fkx->fx", barycentric[q], corners))
            row = np.zeros((len(faces), len(places)))
            for local, value in zip(part, hat, strict=True):
                weighted = share * TRIANGLE_WEIGHTS[q] * value
                row[np.arange(len(faces)), faces[:, local]] = weighted
                for i in range(width):
                    np.add.at(load, (faces[:, i], faces[:, local]), shapes[q, i] * weighted)
            hats.append(row)
    return load, (np.concatenate(points), np.concatenate(hats))
