"""Newmark's scheme: a body in motion under given forces, its damping and its energies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from palpate import _native, units
from palpate.body import Body
from palpate.dynamics.basis import ZERO_EIGENVALUE, Matrices, ModalBasis, basis_key, native, start_vector
from palpate.dynamics.basis import modes as compute_modes
from palpate.equality import ComparedByValue
from palpate.errors import BodyError
from palpate.units import brief_repr
from palpate.vectors import number, number_array, three_numbers

METHODS = ("modal", "sparse", "dense", "exponential")


@dataclass(frozen=True, eq=False)
class Energy(ComparedByValue):
    """Energies of a body in motion, J: numbers, or arrays over the ticks of a recording.

    Attributes
    ----------
    kinetic, strain
        `v M v / 2` and `u K u / 2` now.
    coupling
        Of the springs between tools and body now; zero where forces are given.
    dissipated
        Taken out by damping since the start.
    work
        Done by forces, tools and strikes since the start.

    """

    kinetic: float | np.ndarray
    strain: float | np.ndarray
    coupling: float | np.ndarray
    dissipated: float | np.ndarray
    work: float | np.ndarray

    @property
    def total(self) -> float | np.ndarray:
        """Energy of the body and its couplings now, `kinetic + strain + coupling`, J."""
        return self.kinetic + self.strain + self.coupling


def rayleigh_from_ratios(xi1: float, f1: float, xi2: float, f2: float) -> tuple[float, float]:
    """Factors of `B = a M + b K` that give two frequencies their damping ratios.

    A mode of angular frequency `w` has the ratio `xi = a / (2 w) + b w / 2`; two of them are two equations for a and b.

    Parameters
    ----------
    xi1, f1
        Ratio to critical damping at the frequency f1, Hz.
    xi2, f2
        The same at another frequency.

    Returns
    -------
    tuple[float, float]
        a in 1/s and b in s.

    Raises
    ------
    BodyError
        Equal or non-positive frequencies, or ratios so far apart that a factor would be negative.

    """
    values = (xi1, f1, xi2, f2)
    if not all(np.isfinite(v) for v in values) or min(f1, f2) <= 0 or f1 == f2 or min(xi1, xi2) < 0:
        raise BodyError(f"two different positive frequencies and two ratios of at least 0 are needed, got {values}")
    w1, w2 = 2 * np.pi * f1, 2 * np.pi * f2
    difference = w2**2 - w1**2
    a = 2 * w1 * w2 * (xi1 * w2 - xi2 * w1) / difference
    b = 2 * (xi2 * w2 - xi1 * w1) / difference
    if min(a, b) < 0:
        low, high = sorted((f1 / f2, f2 / f1))
        raise BodyError(
            f"ratios of {xi1} at {f1} Hz and {xi2} at {f2} Hz need a negative factor, which would add energy "
            f"at other frequencies: the quotient of the ratios must lie between {low:.4g} and {high:.4g}"
        )
    return float(a), float(b)


class Newmark:
    """Motion of a body by Newmark's scheme (paper 4.1 to 4.3; its 4.4 corrected).

    `M a + B v + K u = F` holds at the end of every step, with `B = a M + b K`.

    Parameters
    ----------
    body
        With or without supports.
    dt
        Time step, s, or text such as ``"1ms"``.
    alpha, delta
        Weights of the new acceleration in displacement and velocity: (1/4, 1/2) keeps energy, (0, 1/2) is the central
        difference method, (0.3025, 0.6) damps motions that are too fast for the step. Not used by ``"exponential"``.
    rayleigh
        a (1/s) and b (s); see :func:`palpate.rayleigh_from_ratios`.
    mass
        ``"consistent"`` or ``"lumped"``.
    method
        ``"modal"``: one recurrence a mode; with all modes the same motion as ``"sparse"`` (Cholesky factor of the
        effective matrix) and ``"dense"`` (its stored inverse: the paper's method). ``"exponential"``: each mode
        exactly, for forces linear in time within a step.
    modes
        For the modal methods: how many of the lowest, None for all, or a :class:`palpate.ModalBasis`. The static part
        of those left out is added (residual flexibility): exact at rest, without inertia and velocity.
    displacements, velocities
        (n, 3) m and m/s at the start, where the force is zero; None: at rest. Fixed components are ignored; modes left
        out stay at rest.
    progress
        Whether computing modes shows a bar on a terminal.

    Raises
    ------
    BodyError
        A step that is unstable (with the largest stable one), a weight or factor out of range, a body without mass.
    UnitError
        A step that is no time.

    """

    def __init__(
        self,
        body: Body,
        dt: float | str = 1e-3,
        alpha: float = 0.25,
        delta: float = 0.5,
        rayleigh: tuple[float, float] = (0.0, 0.0),
        mass: str = "consistent",
        method: str = "modal",
        modes: int | ModalBasis | None = None,
        *,
        displacements: np.ndarray | None = None,
        velocities: np.ndarray | None = None,
        progress: bool = True,
    ):
        if method not in METHODS:
            raise BodyError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
        if modes is not None and method in ("sparse", "dense"):
            raise BodyError(f"the method '{method}' takes no modes: it moves all dofs")
        if not isinstance(body, Body):
            raise BodyError(f"Newmark takes a palpate.Body, got {brief_repr(body)}")
        self.dt = units.time(dt)
        self._body = body
        self._matrices = Matrices.of(body, mass)
        if isinstance(rayleigh, str) or not isinstance(rayleigh, Iterable) or len(factors := list(rayleigh)) != 2:
            raise BodyError(f"rayleigh must be two factors, a (1/s) and b (s), got {brief_repr(rayleigh)}")
        a, b = (number(factor, "a factor of rayleigh", BodyError) for factor in factors)
        self._scheme = (self.dt, number(alpha, "alpha", BodyError), number(delta, "delta", BodyError), a, b)
        self._largest_eigenvalue: float | None = None
        self._residual: Residual | None = None
        u, v = self._initial(displacements, "displacements"), self._initial(velocities, "velocities")
        self._forces = np.zeros(len(u))
        _native.largest_stable_dt(self._scheme, 1.0)  # refuses numbers out of range before the long work
        if method in ("modal", "exponential"):
            basis = modes if isinstance(modes, ModalBasis) else compute_modes(body, modes, mass=mass, progress=progress)
            self._motion = self._modal(basis, mass, method == "exponential", u, v)
        else:
            self._require_stable()
            matrices = (native(self._matrices.stiffness), native(self._matrices.mass))
            fixed = body.fixed_dofs.tolist()
            self._motion = _native.DirectMotion(*matrices, fixed, self._scheme, method == "dense", u, v)

    def step(self, forces: Mapping[int, Sequence[float]] | None = None, count: int = 1) -> None:
        """Advance.

        Parameters
        ----------
        forces
            Node to force, N, at the end of each of the steps; nodes not named are free of force.
        count
            Number of steps.

        Raises
        ------
        BodyError
            A node that does not exist, not three numbers, a number that is not finite.

        """
        if not isinstance(count, (int, np.integer)) or count < 0:
            raise BodyError(f"the number of steps must be a whole number, got {count!r}")
        load = np.zeros_like(self._forces)
        if not isinstance(forces, Mapping | None):
            raise BodyError(
                f"forces must map nodes to three numbers, such as {{7: (0, 0, -1)}}, got {brief_repr(forces)}"
            )
        for node, force in (forces or {}).items():
            first = 3 * self._node(node)
            load[first : first + 3] += three_numbers(force, f"forces: node {node}", BodyError)
        load[self._body.fixed_dofs] = 0.0
        if count:
            loaded = np.flatnonzero(load)
            self._motion.step(list(zip(loaded.tolist(), load[loaded].tolist(), strict=True)), int(count))
            self._forces = load

    def play(self, nodes: Sequence[int], forces: np.ndarray, watch: Sequence[int] | None = None) -> np.ndarray:
        """Advance through a history of forces.

        Parameters
        ----------
        nodes
            (k,) loaded nodes, each once.
        forces
            (steps, k, 3) N, each row at the end of its step.
        watch
            (w,) nodes to be seen; None: the loaded ones.

        Returns
        -------
        numpy.ndarray
            (steps, w, 3) displacements of the watched nodes after each step, m.

        Raises
        ------
        BodyError
            Nodes that do not exist or are named twice, or forces of another shape or not finite.

        """
        loaded = self._nodes(nodes, "nodes")
        seen = loaded if watch is None else self._nodes(watch, "watch")
        history = number_array(forces, "forces", BodyError)
        if history.ndim != 3 or history.shape[1:] != (len(loaded), 3) or len(set(loaded)) != len(loaded):
            raise BodyError(f"forces must have shape (steps, {len(loaded)}, 3) for as many different nodes")
        if not np.isfinite(history).all():
            raise BodyError("forces have a number that is not finite")
        rows, columns = _dofs(loaded), _dofs(seen)
        history = np.where(np.isin(rows, self._body.fixed_dofs), 0.0, history.reshape(len(history), -1))
        moved = self._motion.play(rows.tolist(), history, columns.tolist())
        if len(history):
            self._forces = np.zeros_like(self._forces)
            self._forces[rows] = history[-1]
        if self._residual is not None:
            for i in np.flatnonzero(history.any(axis=0)):
                unit = np.zeros_like(self._forces)
                unit[rows[i]] = 1.0
                moved += np.outer(history[:, i], self._residual.answer(unit)[columns])
        return moved.reshape(len(history), len(seen), 3)

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self._motion.steps * self.dt

    @property
    def displacements(self) -> np.ndarray:
        """(n, 3) m."""
        return (self._motion.at(None, 0) + self._left_out()).reshape(-1, 3)

    @property
    def velocities(self) -> np.ndarray:
        """(n, 3) m/s."""
        return self._motion.at(None, 1).reshape(-1, 3)

    @property
    def accelerations(self) -> np.ndarray:
        """(n, 3) m/s^2."""
        return self._motion.at(None, 2).reshape(-1, 3)

    @property
    def energy(self) -> Energy:
        """Energies now, and what went in and out since the start.

        Forces do the work of a step with the mean `(1 - delta) F0 + delta F1`, damping takes its part at the mean
        velocity; of ``"exponential"`` both are exact integrals.
        """
        kinetic, strain, dissipated, work = self._motion.energies()
        # The part left out follows the load statically: its strain energy is the work done on it.
        stored = 0.5 * float(self._forces @ self._left_out())
        return Energy(kinetic, strain + stored, 0.0, dissipated, work + stored)

    @property
    def largest_eigenvalue(self) -> float:
        """Largest `omega^2` of the motion, 1/s^2: of the modes kept, or of the whole body, by Lanczos."""
        if self._largest_eigenvalue is None:
            self._largest_eigenvalue = self._matrices.largest_eigenvalue()
        return self._largest_eigenvalue

    @property
    def largest_stable_dt(self) -> float:
        """Largest stable time step with these weights, s; infinite where every step is."""
        if 2 * self._scheme[1] >= self._scheme[2]:
            return np.inf
        return _native.largest_stable_dt(self._scheme, self.largest_eigenvalue)

    def _modal(self, basis: ModalBasis, mass: str, exact: bool, u: np.ndarray, v: np.ndarray) -> _native.ModalMotion:
        if basis.key != basis_key(self._body, mass):
            raise BodyError(f"the modes are not those of this body with its {mass} mass matrix")
        self._largest_eigenvalue = float(basis.eigenvalues[-1])
        if not exact:
            self._require_stable()
        if len(basis) < len(self._matrices.free):
            self._residual = Residual(self._matrices, basis)
        shapes = basis.shapes.reshape(-1, len(basis))
        q, p = (shapes.T @ (self._matrices.mass @ x) for x in (u, v))
        return _native.ModalMotion(basis.eigenvalues, shapes, self._scheme, exact, q, p)

    def _require_stable(self) -> None:
        if 2 * self._scheme[1] < self._scheme[2]:
            _native.require_stable(self._scheme, self.largest_eigenvalue)

    def _left_out(self) -> np.ndarray:
        """Displacements of the modes left out, (3n), m."""
        if self._residual is None or not self._forces.any():
            return np.zeros_like(self._forces)
        return self._residual.answer(self._forces)

    def _initial(self, values: np.ndarray | None, name: str) -> np.ndarray:
        shape = self._body.mesh.nodes.shape
        array = np.zeros(shape) if values is None else number_array(values, f"the initial {name}", BodyError).copy()
        if array.shape != shape or not np.isfinite(array).all():
            raise BodyError(f"the initial {name} must be {shape} finite numbers, got shape {array.shape}")
        array[self._body.fixed_mask] = 0.0
        return array.ravel()

    def _nodes(self, nodes: Sequence[int], what: str) -> list[int]:
        if isinstance(nodes, str) or not isinstance(nodes, Iterable):
            raise BodyError(f"{what} must be a list of node numbers, got {brief_repr(nodes)}")
        return [self._node(node, what) for node in nodes]

    def _node(self, node: int, what: str = "forces") -> int:
        count = len(self._body.mesh.nodes)
        if not isinstance(node, (int, np.integer)) or not 0 <= node < count:
            raise BodyError(f"{what}: node {brief_repr(node)} does not exist: the mesh has nodes 0 to {count - 1}")
        return int(node)


def _dofs(nodes: Sequence[int]) -> np.ndarray:
    return (3 * np.asarray(nodes, dtype=np.int64)[:, None] + np.arange(3)).ravel()


class Residual:
    """Residual flexibility of a basis: the static response of the modes that a truncated one leaves out.

    `R = Psi - Phi diag(1/omega^2) Phi^T` over the elastic modes kept, `Psi` being the static compliance. Its modes are
    so fast against the load that they follow it statically; with it, a constant load ends at the static solution for
    any number of modes. For a body that can move freely, `Psi` is the compliance to self-balanced loads, seen without
    rigid motion. The load is balanced by the inertia of the rigid motions first, and their share is removed from the
    answer.

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
