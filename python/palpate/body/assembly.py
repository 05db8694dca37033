"""Matrices of all dofs, assembled from the elements: dof = 3 * node + axis."""

from __future__ import annotations

import numpy as np
import scipy

from palpate import _native
from palpate.mesh import TetMesh


def stiffness_matrix(mesh: TetMesh, materials: np.ndarray) -> scipy.sparse.csc_array:
    """Stiffness matrix, (3n, 3n) N/m; ``materials`` (m, 3): Young's modulus, Poisson's ratio, density by element."""
    return _csc(_native.stiffness(*element_arrays(mesh, materials)), mesh)


def mass_matrix(mesh: TetMesh, materials: np.ndarray, *, lumped: bool = False) -> scipy.sparse.csc_array:
    """Mass matrix, (3n, 3n) kg; consistent, or lumped to the diagonal."""
    return _csc(_native.mass(*element_arrays(mesh, materials), lumped), mesh)


def element_arrays(mesh: TetMesh, materials: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, elements and materials as the native module takes them."""
    nodes = np.ascontiguousarray(mesh.nodes, dtype=np.float64)
    return nodes, np.ascontiguousarray(mesh.tets, dtype=np.uint32), materials


def _csc(arrays: tuple[np.ndarray, np.ndarray, np.ndarray], mesh: TetMesh) -> scipy.sparse.csc_array:
    start, rows, values = arrays
    size = 3 * len(mesh.nodes)
    return scipy.sparse.csc_array((values, rows.astype(np.int64), start), shape=(size, size))
