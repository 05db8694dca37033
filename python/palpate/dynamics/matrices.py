"""Matrices of the free dofs, their factors and their largest eigenvalue."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from palpate import _native
from palpate.body import Body
from palpate.errors import BodyError

MASS_KINDS = ("consistent", "lumped")
# Seed of the start vectors of iterations: the same body always gives the same bits.
SEED = 20


@dataclass(frozen=True)
class Matrices:
    """Stiffness and mass of a body, all dofs, and the numbers of the free ones."""

    stiffness: scipy.sparse.csc_array
    mass: scipy.sparse.csc_array
    fixed: np.ndarray
    free: np.ndarray

    @classmethod
    def of(cls, body: Body, mass: str) -> Matrices:
        """Assemble; BodyError for an unknown kind of mass matrix, a node without mass, or nothing left free."""
        if mass not in MASS_KINDS:
            raise BodyError(f"mass must be 'consistent' or 'lumped', got {mass!r}")
        stiffness, mass_matrix = body.stiffness(), body.mass(lumped=mass == "lumped")
        free = np.setdiff1d(np.arange(stiffness.shape[0]), body.fixed_dofs)
        if len(free) == 0:
            raise BodyError("every node is fixed, so nothing can move: leave some nodes free")
        weightless = np.flatnonzero(mass_matrix.diagonal()[free] <= 0)
        if weightless.size:
            raise BodyError(f"node {free[weightless[0]] // 3} has no mass: a body in motion needs a positive density")
        return cls(stiffness, mass_matrix, body.fixed_dofs, free)

    @cached_property
    def free_stiffness(self) -> scipy.sparse.csc_array:
        """Stiffness of the free dofs."""
        return self.stiffness[self.free][:, self.free]

    @cached_property
    def free_mass(self) -> scipy.sparse.csc_array:
        """Mass of the free dofs."""
        return self.mass[self.free][:, self.free]

    def factor(self, of_stiffness: float, of_mass: float) -> _native.SparseFactor:
        """Cholesky factor of a combination on the free dofs."""
        return _native.SparseFactor(native(of_stiffness * self.stiffness + of_mass * self.mass), self.fixed.tolist())

    def largest_eigenvalue(self) -> float:
        """Largest `omega^2`, 1/s^2, by Lanczos: the Ritz value, from below, plus the norm of its residual.

        The sum bounds the eigenvalue that the Ritz value approximates; that this is the largest one rests on Lanczos
        finding it, as it does from any start vector that is not orthogonal to it.
        """
        k, m = self.free_stiffness, self.free_mass
        size = k.shape[0]
        factor = self.factor(0.0, 1.0)
        inverse = scipy.sparse.linalg.LinearOperator((size, size), matvec=factor.solve, dtype=np.float64)
        if size <= 10:
            return float(np.linalg.eigvals(np.linalg.solve(m.toarray(), k.toarray())).real.max())
        vectors = min(size - 1, 60)
        limits = {"ncv": vectors, "tol": 1e-7, "maxiter": 1000}
        values, x = scipy.sparse.linalg.eigsh(k, 1, m, which="LA", Minv=inverse, v0=start_vector(size), **limits)
        residual = k @ x[:, 0] - values[0] * (m @ x[:, 0])
        return float(values[0] + np.sqrt(residual @ factor.solve(residual)))


def start_vector(size: int) -> np.ndarray:
    """Start of an iteration, the same every time, orthogonal to nothing in particular."""
    return np.random.default_rng(SEED).uniform(0.5, 1.5, size)


def native(matrix: scipy.sparse.sparray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Column starts, rows and values for the native module."""
    columns = scipy.sparse.csc_array(matrix)
    columns.sort_indices()
    return columns.indptr.astype(np.int64), columns.indices.astype(np.uint32), columns.data.astype(np.float64)
