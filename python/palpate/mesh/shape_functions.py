"""Shape functions of 4- and 10-node tetrahedra and of their faces, for whatever is integrated or evaluated in Python.

In barycentric coordinates `L` of the corners, a corner of a quadratic element has `N_i = L_i (2 L_i - 1)` and the node
on the edge between `i` and `j` has `N_ij = 4 L_i L_j` (Zienkiewicz, The Finite Element Method, volume 1, chapter on
standard elements). Edge nodes are in the order of VTK and meshio.
"""

from __future__ import annotations

import numpy as np

from palpate.mesh.elements import EDGES

# Corners joined by each edge node of a triangle, in their order after the corners, and the nodes' barycentric places.
TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
TRIANGLE_NODES = np.vstack([np.eye(3), np.eye(3)[TRIANGLE_EDGES].mean(axis=1)])

# Symmetric rule of degree 4 on a triangle: barycentric points and weights that sum to one (Dunavant, 1985).
_A, _B = 0.445948490915965, 0.091576213509771
TRIANGLE_POINTS = np.array([np.roll([1 - 2 * p, p, p], k) for p in (_A, _B) for k in range(3)])
TRIANGLE_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


def values(barycentric: np.ndarray, node_count: int, edges: np.ndarray) -> np.ndarray:
    """Shape functions at barycentric points (p, c): (p, node_count)."""
    if node_count == barycentric.shape[1]:
        return barycentric
    corners = barycentric * (2 * barycentric - 1)
    return np.hstack([corners, 4 * barycentric[:, edges[:, 0]] * barycentric[:, edges[:, 1]]])


def derivatives(barycentric: np.ndarray, node_count: int, edges: np.ndarray) -> np.ndarray:
    """Differentiate along the barycentric coordinates after the first, which falls as they rise: (p, n, c - 1)."""
    points, corners = barycentric.shape
    by_coordinate = np.zeros((points, node_count, corners))
    if node_count == corners:
        by_coordinate[:] = np.eye(corners)
    else:
        diagonal = np.arange(corners)
        by_coordinate[:, diagonal, diagonal] = 4 * barycentric - 1
        for k, (i, j) in enumerate(edges):
            by_coordinate[:, corners + k, i] = 4 * barycentric[:, j]
            by_coordinate[:, corners + k, j] = 4 * barycentric[:, i]
    return by_coordinate[:, :, 1:] - by_coordinate[:, :, :1]


def tetrahedron_gradients(nodes: np.ndarray, tets: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
    """Gradients of the shape functions, 1/m, at barycentric points (p, 4) of each element: (m, p, 4 or 10, 3)."""
    local = derivatives(barycentric, tets.shape[1], EDGES)
    jacobian = np.einsum("pnj,mnx->mpxj", local, nodes[tets])
    return np.einsum("pnj,mpjx->mpnx", local, np.linalg.inv(jacobian))


def surface_integrals(nodes: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Integrate shape functions over 3- or 6-node faces.

    Returns
    -------
    tuple
        ``int N_i dA`` (k, 3 or 6), m^2, and ``int N_i n dA`` (k, 3 or 6, 3), m^2; n is outward.

    """
    count = faces.shape[1]
    shapes = values(TRIANGLE_POINTS, count, TRIANGLE_EDGES) * TRIANGLE_WEIGHTS[:, None]
    tangents = np.einsum("pnj,knx->kpjx", derivatives(TRIANGLE_POINTS, count, TRIANGLE_EDGES), nodes[faces])
    # The cross product of the tangents is twice the area element, for the reference triangle has area one half.
    normals = 0.5 * np.cross(tangents[:, :, 0], tangents[:, :, 1])
    areas = np.linalg.norm(normals, axis=2)
    return np.einsum("pn,kp->kn", shapes, areas), np.einsum("pn,kpx->knx", shapes, normals)
