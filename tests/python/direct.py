"""Direct finite element answers to contacts: SciPy on the stiffness, patches as constraints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

import palpate
from palpate import _native

Patch = tuple[np.ndarray, np.ndarray]


def patch_at(green: palpate.GreensFunction, point: Sequence[float], radius: float) -> Patch:
    """Nodes of the mesh under a contact around the surface point closest to ``point`` (m), and their weights."""
    ranks, weights = _native.contact_patch(green._core, tuple(map(float, point)), radius)
    return green.surface_nodes[ranks], weights


def solve_with_patches(
    body: palpate.Body, patches: Sequence[Patch], displacements: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (n, 3), m, and forces on the patches (p, 3), N, for weighted mean displacements (p, 3) of them.

    One solve of `[K B^T; B 0] [u; -f] = [0; d]`, `f` the multipliers: `K u = B^T f` and `B u = d`.
    """
    free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
    K = body.stiffness()[free][:, free]
    B = scipy.sparse.lil_matrix((3 * len(patches), 3 * len(body.mesh.nodes)))
    for rank, (nodes, weights) in enumerate(patches):
        for axis in range(3):
            B[3 * rank + axis, 3 * nodes + axis] = weights
    scale = K.diagonal().mean()
    B = scale * B.tocsc()[:, free]
    system = scipy.sparse.bmat([[K, B.T], [B, None]], format="csc")
    right = np.concatenate([np.zeros(len(free)), scale * np.ravel(displacements)])
    solved = scipy.sparse.linalg.spsolve(system, right)
    u = np.zeros(3 * len(body.mesh.nodes))
    u[free] = solved[: len(free)]
    return u.reshape(-1, 3), -scale * solved[len(free) :].reshape(-1, 3)
