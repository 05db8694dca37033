"""Residual flexibility: the static response of the modes that a truncated basis leaves out.

`R = Psi - Phi diag(1/omega^2) Phi^T` over the elastic modes kept, `Psi` being the static compliance. Its modes are so
fast against the load that they follow it statically; with it, a constant load ends at the static solution for any
number of modes. For a body that can move freely, `Psi` is the compliance to self-balanced loads, seen without rigid
motion: the load is balanced by the inertia of the rigid motions first, and their share is removed from the answer.
"""

from __future__ import annotations

import numpy as np
import scipy

from palpate import _native
from palpate.dynamics.basis import ZERO_EIGENVALUE, ModalBasis
from palpate.dynamics.matrices import Matrices, native, start_vector
from palpate.errors import BodyError


class Residual:
    """Residual flexibility of a basis.

    Raises
    ------
    BodyError
        A body that can move freely, and a basis without all of its rigid motions.

    """

    def __init__(self, matrices: Matrices, basis: ModalBasis):
        self._free = matrices.free
        self._shapes = basis.shapes.reshape(-1, len(basis))[matrices.free]
        self._eigenvalues = basis.eigenvalues
        rigid = basis.eigenvalues == 0.0
        self._rigid = self._shapes[:, rigid]
        self._mass_rigid = matrices.free_mass @ self._rigid
        # As many dofs are fixed as there are rigid motions, those that determine them best (pivoted QR).
        order = scipy.linalg.qr(self._rigid.T, mode="r", pivoting=True)[1] if rigid.any() else np.empty(0, dtype=int)
        pinned = order[: self._rigid.shape[1]]
        self._kept = np.setdiff1d(np.arange(len(self._free)), pinned)
        fixed = np.union1d(matrices.fixed, self._free[pinned])
        lacking = f"a truncated basis needs all rigid motions of the body; the first {len(basis)} modes lack some"
        try:
            self._factor = _native.SparseFactor(native(matrices.stiffness), fixed.tolist())
        except BodyError:
            raise BodyError(lacking) from None
        if rigid.any() and self._is_loose(matrices):
            raise BodyError(lacking)

    def _is_loose(self, matrices: Matrices) -> bool:
        """Whether the pinned body can still move as a rigid one: round-off may give a singular matrix a factor.

        A step of inverse iteration then ends at that motion, whose Rayleigh quotient is round-off.
        """
        moved = np.zeros(len(self._free))
        moved[self._kept] = self._factor.solve(start_vector(len(self._kept)))
        quotient = (moved @ (matrices.free_stiffness @ moved)) / (moved @ (matrices.free_mass @ moved))
        scale = (matrices.free_stiffness.diagonal() / matrices.free_mass.diagonal()).max()
        return bool(quotient < ZERO_EIGENVALUE * scale)

    def answer(self, forces: np.ndarray) -> np.ndarray:
        """Displacements (3n), m, that the modes leave out under forces (3n), N."""
        load = forces[self._free]
        balanced = load - self._mass_rigid @ (self._rigid.T @ load)
        answer = np.zeros(len(self._free))
        answer[self._kept] = self._factor.solve(balanced[self._kept])
        answer -= self._rigid @ (self._mass_rigid.T @ answer)
        modal = self._shapes.T @ load
        elastic = self._eigenvalues > 0.0
        answer -= self._shapes[:, elastic] @ (modal[elastic] / self._eigenvalues[elastic])
        everywhere = np.zeros(len(forces))
        everywhere[self._free] = answer
        return everywhere
