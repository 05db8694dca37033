"""Contact imposed at the points of the mesh's own faces, as most programs impose it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg
from scipy.optimize import nnls

from palpate.green import GreensFunction
from palpate.mesh import TetMesh
from palpate.mesh.shape_functions import TRIANGLE_EDGES, TRIANGLE_POINTS, TRIANGLE_WEIGHTS, values
from palpate.validation.verify.contact.signorini import (
    Gap,
    compliance_along,
    faces_on,
    triangle_areas,
)


def forces_at_mesh_points(
    green: GreensFunction, mesh: TetMesh, gap: Gap, depths: Sequence[float], penalty: float = 1e8
) -> list[float]:
    """Press a tool that is kept out at the quadrature points of the mesh's own faces, as most programs do; forces, N.

    The points of a face can only move as its nodes do, so a contact smaller than a face locks. Minimum over `p >= 0` of
    `p.(B^T Psi B + diag(1/(kappa w))) p/2 - p.(d - g)`, B the shape functions at the points, w their areas.

    Parameters
    ----------
    green, mesh
        The body, with the top touchable.
    gap, depths
        As of ``ContactProblem.press``.
    penalty
        kappa, Pa/m: as good as rigid, and there may be more points than a face has freedoms.

    """
    up = np.array([0.0, 0.0, 1.0])
    faces = faces_on(green, mesh, mesh.nodes[mesh.nodes[:, 2].argmax()], up)
    nodes, local = np.unique(faces, return_inverse=True)
    corners = mesh.nodes[faces[:, :3], :2]
    shapes = values(TRIANGLE_POINTS, faces.shape[1], TRIANGLE_EDGES)
    points = np.einsum("qk,fkx->fqx", TRIANGLE_POINTS, corners).reshape(-1, 2)
    areas = np.outer(triangle_areas(corners), TRIANGLE_WEIGHTS).ravel()
    near = np.flatnonzero(gap(points) < 2 * max(depths))
    rows = np.zeros((len(near), len(nodes)))
    local = local.reshape(faces.shape)
    for row, point in zip(rows, near, strict=True):
        row[local[point // len(shapes)]] = shapes[point % len(shapes)]
    compliance = rows @ compliance_along(green, nodes, up) @ rows.T + np.diag(1 / (penalty * areas[near]))
    factor = scipy.linalg.cholesky(compliance, lower=True)
    gaps = gap(points[near])
    solved = [scipy.linalg.solve_triangular(factor, depth - gaps, lower=True) for depth in depths]
    return [float(nnls(factor.T, right, maxiter=5000)[0].sum()) for right in solved]
