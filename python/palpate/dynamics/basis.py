"""Eigenmodes of a body, computed once and stored in a file, from the matrices of its free dofs."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from palpate import _native
from palpate.atomic import destination, remove_leftovers
from palpate.body import Body, description
from palpate.cache import cache_directory, hold, make_room
from palpate.errors import BodyError, StoreError
from palpate.progress import progress_reporter, status_line

MASS_KINDS = ("consistent", "lumped")
# Seed of the start vectors of iterations: the same body always gives the same bits.
SEED = 20
# Up to so many free dofs the dense solver is quicker than Lanczos for most counts.
DENSE_DOFS = 1500
# All modes of more dofs are refused: the shapes alone would take gigabytes, the work hours.
ALL_MODES_DOFS = 12_000
# An eigenvalue below this part of the largest `K_ii / M_ii` is round-off of a rigid motion and set to zero.
ZERO_EIGENVALUE = 1e-12


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


class ModalBasis:
    """Natural modes of a body, mass-normalised: `Phi^T M Phi = I`, `Phi^T K Phi = diag(omega^2)`.

    Made by :func:`modes` or :meth:`load`; immutable.

    Attributes
    ----------
    eigenvalues
        `omega^2`, ascending, (m,), 1/s^2.
    shapes
        (n, 3, m), 1/sqrt(kg); zero at fixed dofs. The largest component of each is positive.
    key
        Hash of everything that determines the modes.
    description
        What they were made from.

    """

    def __init__(self, eigenvalues: np.ndarray, shapes: np.ndarray, key: str, description: dict[str, Any]):
        self.eigenvalues = eigenvalues
        self.shapes = shapes
        self.key = key
        self.description = description
        for array in (eigenvalues, shapes):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.eigenvalues)

    def __repr__(self) -> str:
        low, high = self.frequencies[[0, -1]]
        return f"ModalBasis({len(self)} modes, {low:.4g} to {high:.4g} Hz, {self.mass} mass)"

    @property
    def frequencies(self) -> np.ndarray:
        """Natural frequencies, Hz, ascending (m,); rigid motions are exactly zero."""
        return np.sqrt(self.eigenvalues) / (2 * np.pi)

    @property
    def mass(self) -> str:
        """Mass matrix they belong to, ``"consistent"`` or ``"lumped"``."""
        return self.description["mass"]

    def first(self, count: int) -> ModalBasis:
        """Return the lowest modes.

        Raises
        ------
        BodyError
            More than there are.

        """
        if not 1 <= count <= len(self):
            raise BodyError(f"the basis has {len(self)} modes, {count} are wanted")
        if count == len(self):
            return self
        shapes = np.ascontiguousarray(self.shapes[:, :, :count])
        return ModalBasis(self.eigenvalues[:count].copy(), shapes, self.key, self.description)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file; an existing one is replaced only when the new one is complete."""
        shapes = self.shapes.reshape(-1, len(self))
        target = destination(Path(path), StoreError)
        remove_leftovers(target)
        _native.save_basis(target, self.key, json.dumps(self.description), self.eigenvalues, shapes)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, body: Body | None = None, mass: str | None = None) -> ModalBasis:
        """Read a file and verify it.

        Parameters
        ----------
        path
            The file.
        body
            Refuse modes of any other body.
        mass
            Refuse modes of another mass matrix.

        Raises
        ------
        StoreError
            A damaged file, or one that does not match; the message says what differs.

        """
        path = Path(path)
        if not path.exists():
            raise StoreError(f"{path}: no such file")
        key, description, eigenvalues, shapes = _native.load_basis(path)
        basis = cls(eigenvalues, shapes.reshape(-1, 3, len(eigenvalues)), key, json.loads(description))
        if mass is not None and basis.mass != mass:
            raise StoreError(f"{path}: was made with the {basis.mass} mass matrix, but the {mass} one is needed")
        if body is not None and key != basis_key(body, basis.mass):
            raise StoreError(f"{path}: {_difference(basis, body)}; compute it again")
        return basis


def modes(
    body: Body,
    count: int | None = None,
    *,
    mass: str = "consistent",
    path: str | os.PathLike[str] | None = None,
    progress: bool | Callable[[int, int], None] = True,
) -> ModalBasis:
    """Lowest natural modes of a body, from their file if that matches, else computed and written there.

    Small bodies go to LAPACK; large ones to shift-inverted Lanczos (ARPACK) on the sparse Cholesky factor of
    `K - sigma M`, with sigma = 0, or negative for a body that can move freely. The same body gives the same numbers.

    Parameters
    ----------
    body
        Any body, also without supports: its rigid motions come first, with frequencies of exactly zero (eigenvalues
        below 1e-12 of the largest `K_ii / M_ii` are taken for them).
    count
        How many; None: all, as long as there are at most 12,000 free dofs.
    mass
        ``"consistent"`` or ``"lumped"``.
    path
        File; None keeps it in the cache under its content key.
    progress
        True shows a bar on a terminal; a function is called with solves done and expected.

    Raises
    ------
    BodyError
        More modes than free dofs, all modes of a body too large for that, a node without mass.

    """
    key = basis_key(body, mass)
    if path is None:
        target = cache_directory() / f"{key[:32]}-{count or 'all'}.modes.palpate"
        target.parent.mkdir(parents=True, exist_ok=True)
    else:
        target = Path(path)
    free = body.fixed_mask.size - len(body.fixed_dofs)
    wanted = free if count is None else _checked_count(count, free)
    if target.exists():
        with contextlib.suppress(StoreError):
            basis = ModalBasis.load(target, body=body, mass=mass)
            if len(basis) >= wanted:
                hold(target, basis)
                return basis.first(wanted)
    if count is None and free > ALL_MODES_DOFS:
        size = 8e-9 * free**2
        raise BodyError(f"all modes of {free} free dofs would take {size:.0f} GB: give a count, such as 200")
    matrices = Matrices.of(body, mass)
    if free <= DENSE_DOFS or 3 * wanted > free:
        if callable(progress):
            progress(0, 1)  # LAPACK does not say how far it is
        with status_line(f"computing {wanted} modes of {free} dofs"):
            eigenvalues, vectors = _dense(matrices, wanted)
    else:
        with progress_reporter("computing modes", progress) as report:
            eigenvalues, vectors = _lanczos(body, matrices, wanted, report)
    basis = _basis(matrices, eigenvalues, vectors, key, {**description(body), "mass": mass, "modes": wanted})
    basis.save(target)
    if path is None:
        hold(target, basis)
        make_room(keep=target)
    return basis


def _checked_count(count: int, free: int) -> int:
    if not isinstance(count, (int, np.integer)) or isinstance(count, bool) or not 1 <= count <= free:
        raise BodyError(f"the number of modes must lie between 1 and {free}, got {count!r}")
    return int(count)


def _dense(matrices: Matrices, count: int) -> tuple[np.ndarray, np.ndarray]:
    stiffness, mass = matrices.free_stiffness.toarray(), matrices.free_mass.toarray()
    subset = None if count == len(stiffness) else (0, count - 1)
    return scipy.linalg.eigh(
        stiffness, mass, subset_by_index=subset, overwrite_a=True, overwrite_b=True, check_finite=False
    )


def _lanczos(
    body: Body, matrices: Matrices, count: int, report: Callable[[int, int], None] | None
) -> tuple[np.ndarray, np.ndarray]:
    sigma = _shift(body)
    factor = matrices.factor(1.0, -sigma)
    size = len(matrices.free)
    vectors = min(size - 1, max(2 * count, count + 40))
    # Lanczos needs about one solve a vector, and as many again in its restarts.
    solves, expected = 0, 2 * vectors

    def solve(right: np.ndarray) -> np.ndarray:
        nonlocal solves
        solves += 1
        if report is not None and solves % 8 == 0:
            report(solves, max(expected, solves))
        return factor.solve(np.ascontiguousarray(right))

    inverse = scipy.sparse.linalg.LinearOperator((size, size), matvec=solve, dtype=np.float64)
    stiffness, mass = matrices.free_stiffness, matrices.free_mass
    eigsh = scipy.sparse.linalg.eigsh
    return eigsh(stiffness, count, mass, sigma=sigma, OPinv=inverse, v0=start_vector(size), ncv=vectors)


def _shift(body: Body) -> float:
    """Zero for a supported body; else about minus the square of its first elastic frequency: `K - sigma M` is SPD."""
    try:
        body.require_supported()
    except BodyError:
        rows = body.element_materials
        length = np.linalg.norm(np.ptp(body.mesh.nodes, axis=0))
        return -float(rows[:, 0].min() / (rows[:, 2].max() * length**2))
    return 0.0


def _basis(
    matrices: Matrices, eigenvalues: np.ndarray, vectors: np.ndarray, key: str, description: dict[str, Any]
) -> ModalBasis:
    order = np.argsort(eigenvalues, kind="stable")
    eigenvalues, vectors = eigenvalues[order], vectors[:, order]
    scale = (matrices.free_stiffness.diagonal() / matrices.free_mass.diagonal()).max()
    eigenvalues = np.where(eigenvalues < ZERO_EIGENVALUE * scale, 0.0, eigenvalues)
    largest = np.abs(vectors).argmax(axis=0)
    vectors = vectors * np.sign(vectors[largest, np.arange(len(largest))])
    shapes = np.zeros((matrices.stiffness.shape[0], len(eigenvalues)))
    shapes[matrices.free] = vectors
    return ModalBasis(eigenvalues, shapes.reshape(-1, 3, len(eigenvalues)), key, description)


def basis_key(body: Body, mass: str) -> str:
    """Hash of everything that determines the modes of a body."""
    nodes, tets, materials = body._element_arrays()
    width = np.array(tets.shape[1], dtype=np.uint32)
    fixed = body.fixed_dofs.astype(np.uint32)
    parts = [mass.encode(), *(np.ascontiguousarray(a).tobytes() for a in (width, nodes, tets, materials, fixed))]
    return _native.basis_key(parts)


def _difference(basis: ModalBasis, body: Body) -> str:
    """First thing in which a file and a body are seen to differ."""
    now = description(body)
    for name in ("nodes", "tets", "surface_nodes", "fixed_nodes", "materials"):
        there = basis.description.get(name)
        if there != now[name]:
            return f"was made for another body ({name.replace('_', ' ')}: {there} there, {now[name]} here)"
    fixed_there = np.flatnonzero(~basis.shapes.any(axis=2).ravel())
    if not np.array_equal(fixed_there, body.fixed_dofs):
        return "was made for another body (other dofs are fixed)"
    return "was made for another body (node positions or elements differ)"
