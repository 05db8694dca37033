"""Other solvers as the engine of the same Newmark step, where they are installed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

Solve = Callable[[np.ndarray], np.ndarray]


def dense_inverse(matrix: scipy.sparse.csc_array) -> Solve:
    """Return the stored inverse times a vector: the paper's method."""
    inverse = np.linalg.inv(matrix.toarray())
    return lambda right: inverse @ right


def superlu(matrix: scipy.sparse.csc_array) -> Solve:
    """Return SciPy's own solver, with the order that suits symmetric matrices."""
    factor = scipy.sparse.linalg.splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return factor.solve


def cholmod(matrix: scipy.sparse.csc_array) -> Solve:
    """Return CHOLMOD by scikit-sparse, whose names changed with version 0.5."""
    from sksparse import cholmod as library

    if hasattr(library, "cho_factor"):
        return library.cho_factor(matrix).solve
    return library.cholesky(scipy.sparse.csc_matrix(matrix))


def pardiso(matrix: scipy.sparse.csc_array) -> Solve:
    """Return MKL PARDISO by pypardiso, without its comparison of the whole matrix at every solve."""
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver(mtype=2)  # symmetric positive definite, upper triangle
    upper = scipy.sparse.csr_matrix(scipy.sparse.triu(matrix, format="csr"))
    solver.set_phase(12)
    solver._call_pardiso(upper, np.zeros((matrix.shape[0], 1)))
    solver.set_phase(33)
    return lambda right: solver._call_pardiso(upper, right[:, None])[:, 0]


SPARSE = {"SuperLU": superlu, "CHOLMOD": cholmod, "PARDISO": pardiso}


def installed() -> dict[str, Callable[[scipy.sparse.csc_array], Solve]]:
    """Return the sparse solvers that answer a small system here."""
    small = scipy.sparse.csc_array(np.diag([2.0, 3.0]))
    found = {}
    for name, make in SPARSE.items():
        try:
            answer = make(small)(np.array([2.0, 3.0]))
        except (ImportError, OSError):
            continue
        if np.allclose(answer, 1.0):
            found[name] = make
    return found


class Stepper:
    """Average acceleration in displacements, equations 4.4 (corrected) and 4.5 of the paper.

    Parameters
    ----------
    stiffness, mass
        Free dofs.
    rayleigh
        a in 1/s and b in s.
    dt
        s.
    make
        Factorises the effective stiffness.

    """

    def __init__(
        self,
        stiffness: scipy.sparse.csc_array,
        mass: scipy.sparse.csc_array,
        rayleigh: tuple[float, float],
        dt: float,
        make: Callable[[scipy.sparse.csc_array], Solve],
    ):
        self._dt, self._mass = dt, mass
        self._damping = scipy.sparse.csc_array(rayleigh[0] * mass + rayleigh[1] * stiffness)
        self._solve = make(scipy.sparse.csc_array(4 / dt**2 * mass + 2 / dt * self._damping + stiffness))
        self.u, self.v, self.a = (np.zeros(mass.shape[0]) for _ in range(3))

    def step(self, force: np.ndarray) -> None:
        """Advance under the force at the end of the step."""
        dt, u, v, a = self._dt, self.u, self.v, self.a
        effective = force + self._mass @ (4 / dt**2 * u + 4 / dt * v + a) + self._damping @ (2 / dt * u + v)
        self.u = self._solve(effective)
        self.a = 4 / dt**2 * (self.u - u) - 4 / dt * v - a
        self.v = v + 0.5 * dt * (a + self.a)
