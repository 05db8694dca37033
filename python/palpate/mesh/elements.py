"""Node orders of the elements (VTK's): corners, then the middles of the edges 01, 12, 02, 03, 13, 23."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
import scipy

from palpate.errors import MeshError
from palpate.mesh.triangles import area_vectors, units

# Corners of each edge, in the order of the mid-side nodes.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])

# By the number of an element's nodes. Its faces, opposite each corner, counter-clockwise seen from outside a positively
# oriented tetrahedron: corners, then the middles of the face's edges 01, 12, 20.
FACES = {
    4: np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]),
    10: np.array([[1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6], [0, 1, 3, 4, 8, 7], [0, 2, 1, 6, 5, 4]]),
}

# The nodes in the order that turns an element inside out: corners 1 and 2 change places, and their edges' middles.
MIRRORED = {4: np.array([0, 2, 1, 3]), 10: np.array([0, 2, 1, 3, 6, 5, 4, 7, 9, 8])}

# By the number of a face's nodes: the flat triangles it is drawn by.
FACE_TRIANGLES = {3: np.array([[0, 1, 2]]), 6: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])}

# Of a 10-node element: the eighths at its corners; the diagonals of the octahedron between them, counted from its first
# middle; and the octahedron cut along each.
AT_CORNERS = np.array([[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]])
DIAGONALS = np.array([[0, 5], [1, 3], [2, 4]])
INSIDE = np.array(
    [
        [[4, 9, 5, 6], [4, 9, 6, 7], [4, 9, 7, 8], [4, 9, 8, 5]],
        [[5, 7, 4, 8], [5, 7, 8, 9], [5, 7, 9, 6], [5, 7, 6, 4]],
        [[6, 8, 4, 5], [6, 8, 5, 9], [6, 8, 9, 7], [6, 8, 7, 4]],
    ]
)

# By the number of an element's nodes: the flat tetrahedra it is drawn by.
PARTS = {4: np.array([[0, 1, 2, 3]]), 10: np.vstack([AT_CORNERS, INSIDE[2]])}


def drawing_triangles(faces: np.ndarray) -> np.ndarray:
    """Flat triangles of faces with 3 or 6 nodes, (k, 3), in the faces' order."""
    return faces[:, FACE_TRIANGLES[faces.shape[1]]].reshape(-1, 3)


def drawing_tets(tets: np.ndarray) -> np.ndarray:
    """Flat tetrahedra of elements with 4 or 10 nodes, (k, 4), in the elements' order."""
    return tets[:, PARTS[tets.shape[1]]].reshape(-1, 4)


def corner_volumes(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Volume between the corners of each element, (m,), negative where they are inverted."""
    a, b, c, d = (nodes[tets[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0


def longest_edges(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Longest distance between two corners of each element, (m,)."""
    corners = nodes[tets[:, :4]]
    return np.max([np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i, j in EDGES], axis=0)


def smallest_dihedral_angles(nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Smallest dihedral angle of each element, (m,) degrees, by its corners; negative where these are inverted."""
    areas = area_vectors(nodes[tets[:, FACES[4]]])
    signed = np.einsum("ij,ij->i", areas[:, 3], nodes[tets[:, 3]] - nodes[tets[:, 0]])
    normals = units(areas)
    cosines = np.einsum("eik,ejk->eij", normals, normals)
    i, j = np.triu_indices(4, 1)
    # A face without an area has no normal: its element is flat.
    cosines = np.where(areas.any(axis=2).all(axis=1)[:, None], cosines[:, i, j], -1.0)
    angles = 180.0 - np.degrees(np.arccos(np.clip(cosines, -1, 1))).max(axis=1)
    return np.where(signed < 0, angles, -180.0)


def unique_edges(tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges of all elements once, (e, 2) corners ascending, and each element's six among them, (m, 6)."""
    ends = np.sort(tets[:, EDGES].reshape(-1, 2).astype(np.int64), axis=1)
    count = int(tets.max()) + 1
    keys, which = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    return np.stack([keys // count, keys % count], axis=1), which.reshape(-1, 6)


def kuhn_tets(shape: Sequence[int]) -> np.ndarray:
    """Six tetrahedra for each cell of a lattice of points (a, b, c), (6 cells, 4): paths along the axes (Kuhn 1960)."""
    index = np.arange(np.prod(shape)).reshape(shape)
    paths = []
    for order in permutations(range(3)):
        corner, path = np.zeros(3, dtype=int), []
        for axis in (*order, None):
            low = tuple(slice(c, s - 1 + c) for c, s in zip(corner, shape, strict=True))
            path.append(index[low].ravel())
            if axis is not None:
                corner[axis] = 1
        paths.append(np.column_stack(path))
    return np.concatenate(paths)


def _face_keys(corners: np.ndarray) -> np.ndarray:
    """One number a face (k,) by its corners (k, 3) in any order.

    Rows would be compared under the interpreter's lock, and five times as slowly.
    """
    ordered, count = np.sort(corners.astype(np.int64), axis=1), int(corners.max()) + 1
    _, low = np.unique(ordered[:, 0] * count + ordered[:, 1], return_inverse=True)
    return low * count + ordered[:, 2]


def boundary_faces(tets: np.ndarray) -> np.ndarray:
    """Faces of one element only, outward, in the elements' order: (k, 3), or (k, 6) of 10-node elements.

    Raises MeshError for a face of more than two elements.
    """
    of_element = FACES[tets.shape[1]]
    return tets[:, of_element].reshape(-1, of_element.shape[1])[_boundary_ranks(tets)]


def face_owners(tets: np.ndarray) -> np.ndarray:
    """Element (k,) that each of :func:`boundary_faces` belongs to."""
    return _boundary_ranks(tets) // 4


def _boundary_ranks(tets: np.ndarray) -> np.ndarray:
    """Ranks, among the faces of all elements, of those of one element only."""
    corners = tets[:, FACES[tets.shape[1]][:, :3]].reshape(-1, 3)
    _, first, inverse, counts = np.unique(
        _face_keys(corners), return_index=True, return_inverse=True, return_counts=True
    )
    if counts.max() > 2:
        face = int(np.flatnonzero(counts[inverse.ravel()] > 2)[0])
        raise MeshError(f"a face of tetrahedron {face // 4} is shared by more than two tetrahedra")
    return np.sort(first[counts == 1])


def face_parts(tets: np.ndarray) -> np.ndarray:
    """Label of the part of elements connected by faces that each element belongs to, (m,)."""
    keys = _face_keys(tets[:, FACES[4]].reshape(-1, 3))
    order = np.argsort(keys)
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    a, b = order[same] // 4, order[same + 1] // 4
    graph = scipy.sparse.coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(len(tets), len(tets)))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
