"""Natural frequencies of 10-node tetrahedra: beams in bending and along their axis, and a thick plate (NAFEMS FV52)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.optimize

from palpate.body import Body, Material
from palpate.dynamics import ModalBasis
from palpate.validation.verify.benchmark import Check, Outcome, modes_of
from palpate.validation.verify.grids import box

# Beam of square section, ten times longer than deep.
LENGTH, DEPTH = 0.1, 0.01
RUBBER = Material(1e6, 0.3, 1000.0)
BEAM_CELLS = (20, 2, 2)
BEAM = "Timoshenko's beam, Cowper's shear factor"
# NAFEMS FV52: 10 x 10 x 1 m of steel.
PLATE, STEEL = (10.0, 10.0, 1.0), Material(200e9, 0.3, 8000.0)
PLATE_CELLS = (16, 16, 2)
# Half waves along x and y, and the closed form of a thick plate, Hz.
PLATE_BENDING = {(1, 1): 45.897, (1, 2): 109.44, (2, 2): 167.89}


def clamped_beam() -> Outcome:
    """First bending and axial frequencies of a beam with one end that stays in its plane."""
    mesh = box(BEAM_CELLS, (LENGTH, DEPTH, DEPTH), quadratic=True)
    end, middle = mesh.nodes[:, 0] < 1e-9, np.abs(mesh.nodes - DEPTH / 2) < 1e-9
    body = Body(mesh, material=RUBBER, fixed=np.column_stack([end, end & middle[:, 1], end & middle[:, 2]]))
    basis = modes_of(body, 24)
    across, along = _along_the_axis(body, basis)
    checks = _beam_checks(basis.frequencies[across], timoshenko_frequencies("clamped", 3))
    speed = np.sqrt(RUBBER.youngs_modulus / RUBBER.density)
    source = "bar, (2 k - 1) / (4 L) sqrt(E / rho)"
    for k, frequency in enumerate(basis.frequencies[along][:2], 1):
        checks.append(Check(f"axial {k}", float(frequency), (2 * k - 1) * speed / (4 * LENGTH), source, 0.02, "Hz"))
    return Outcome([*checks, _mass(body, LENGTH * DEPTH**2)])


def free_beam() -> Outcome:
    """Six rigid motions and the first bending frequencies of a beam without supports."""
    body = Body(box(BEAM_CELLS, (LENGTH, DEPTH, DEPTH), quadratic=True), material=RUBBER, fixed=None)
    basis = modes_of(body, 20)
    rigid = int(np.count_nonzero(basis.frequencies == 0.0))
    across, _ = _along_the_axis(body, basis)
    bending = basis.frequencies[across & (basis.frequencies > 0)]
    checks = _beam_checks(bending, timoshenko_frequencies("free", 3))
    return Outcome([Check("frequencies that are zero", rigid, 6, "rigid motions", 0.0), *checks])


def plate() -> Outcome:
    """NAFEMS FV52 with hard simple supports: on the sides nothing moves along them, neither up nor across.

    With only the lower edges fixed, as in the original, solids do not converge to the closed form but 5 % below it.
    """
    mesh = box(PLATE_CELLS, PLATE, quadratic=True)
    sides = [(np.abs(x) < 1e-9) | (np.abs(x - 10.0) < 1e-9) for x in mesh.nodes.T[:2]]
    fixed = np.column_stack([sides[1], sides[0], sides[0] | sides[1]])
    body = Body(mesh, material=STEEL, fixed=fixed)
    basis = modes_of(body, 10)
    squared = np.einsum("nam,nam->am", basis.shapes, basis.shapes)
    bends = squared[2] > squared[:2].sum(axis=0)
    bending, membrane = basis.frequencies[bends], basis.frequencies[~bends]
    # One half wave along one side and two along the other is a pair.
    computed = (bending[0], bending[1:3].mean(), bending[3])
    checks = []
    for (waves, target), frequency in zip(PLATE_BENDING.items(), computed, strict=True):
        title = f"bending {waves[0]}, {waves[1]}"
        checks.append(Check(title, float(frequency), target, "NAFEMS FV52, closed form", 0.01, "Hz"))
        exact = plate_frequency(waves, target)
        checks.append(Check(title, float(frequency), exact, "elasticity in three dimensions", 0.005, "Hz"))
    # In-plane shear, u_x = sin(pi y / b) alone: a wave of half its length across the plate.
    shear = STEEL.youngs_modulus / (2 * (1 + STEEL.poissons_ratio))
    target = np.sqrt(shear / STEEL.density) / (2 * PLATE[0])
    for name, frequency in zip(("first", "second"), membrane[:2], strict=True):
        checks.append(Check(f"membrane, {name}", float(frequency), target, "sqrt(G / rho) / (2 b)", 0.002, "Hz"))
    return Outcome([*checks, _mass(body, float(np.prod(PLATE)))])


def timoshenko_frequencies(end: str, count: int, length: float = LENGTH, depth: float = DEPTH) -> np.ndarray:
    """First bending frequencies of Timoshenko's beam of square section, Hz.

    With shear and rotatory inertia (Timoshenko 1921), for motions `w, psi ~ cos(omega t)`,

        w' = psi + V / (kappa G A),  psi' = M / (E I),  M' = -V - rho I omega^2 psi,  V' = -rho A omega^2 w

    is `y' = B y`, so that `y(L) = exp(B L) y(0)`: the frequency equation says that the forces at the free end vanish
    for some motion that the other end allows. Cowper (1966): `kappa = 10 (1 + nu) / (12 + 11 nu)` for a rectangle.

    Parameters
    ----------
    end
        ``"clamped"`` or ``"free"``; the other end is free.
    count
        How many.
    length, depth
        m.

    """
    young, nu, density = RUBBER.youngs_modulus, RUBBER.poissons_ratio, RUBBER.density
    area, inertia = depth**2, depth**4 / 12
    kappa, shear = 10 * (1 + nu) / (12 + 11 * nu), young / (2 * (1 + nu))
    known = slice(0, 2) if end == "free" else slice(2, 4)  # what may differ from zero at the other end
    # Lengths in L, forces in E I / L^2, omega in that of Euler's beam, sqrt(E I / (rho A L^4)).
    flexible, rotatory = young * inertia / (kappa * shear * area * length**2), inertia / (area * length**2)

    def forces_at_the_end(omega: float) -> float:
        o = omega**2
        b = np.array([[0, 1, 0, flexible], [0, 0, 1, 0], [0, -o * rotatory, 0, -1], [-o, 0, 0, 0]])
        return float(np.linalg.det(scipy.linalg.expm(b)[2:4, known]))

    found = _first_roots(forces_at_the_end, count)
    return found * np.sqrt(young * inertia / (density * area * length**4)) / (2 * np.pi)


def plate_frequency(waves: tuple[int, int], near: float) -> float:
    """Bending frequency of the plate in three-dimensional elasticity, Hz, within a tenth of ``near``.

    `u = U cos px sin qy, v = V sin px cos qy, w = W sin px sin qy`, with amplitudes over the thickness, meets the hard
    simple supports exactly (Srinivas, Rao and Rao 1970). With `D = W' - p U - q V` and `k^2 = p^2 + q^2` there remain

        mu U'' = (mu k^2 - rho omega^2) U - (lambda + mu) p D,  V likewise,
        (lambda + 2 mu) W'' = (mu k^2 - rho omega^2) W + (lambda + mu) (p U' + q V')

    and faces without stress, `U' + p W = V' + q W = lambda D + 2 mu W' = 0`.
    """
    young, nu, thickness = STEEL.youngs_modulus, STEEL.poissons_ratio, PLATE[2]
    mu, ratio = young / (2 * (1 + nu)), 2 * nu / (1 - 2 * nu)  # ratio: lambda over mu
    p, q = (np.pi * count / side for count, side in zip(waves, PLATE, strict=False))
    # On a face the slopes follow from the amplitudes; stress over mu from both.
    slopes = np.array([[0, 0, -p], [0, 0, -q], [ratio * p / (ratio + 2), ratio * q / (ratio + 2), 0]])
    start = np.vstack([np.eye(3), slopes])
    stress = np.array([[0, 0, p, 1, 0, 0], [0, 0, q, 0, 1, 0], [-ratio * p, -ratio * q, 0, 0, 0, ratio + 2]])

    def stress_on_the_other_face(frequency: float) -> float:
        stiff = p**2 + q**2 - STEEL.density * (2 * np.pi * frequency) ** 2 / mu
        g, h = ratio + 1, ratio + 2
        b = np.zeros((6, 6))
        b[:3, 3:] = np.eye(3)
        b[3, [0, 1, 5]] = stiff + g * p * p, g * p * q, -g * p
        b[4, [0, 1, 5]] = g * p * q, stiff + g * q * q, -g * q
        b[5, [2, 3, 4]] = stiff / h, g * p / h, g * q / h
        return float(np.linalg.det(stress @ scipy.linalg.expm(thickness * b) @ start))

    return float(scipy.optimize.brentq(stress_on_the_other_face, 0.9 * near, 1.1 * near, xtol=1e-9))


def _first_roots(function: Callable[[float], float], count: int) -> np.ndarray:
    """Positive roots, of which no two lie closer than the step of the search: those of a beam are 18 and more apart."""
    roots, low, step = [], 1.0, 1.0
    while len(roots) < count:
        if function(low) * function(low + step) < 0:
            roots.append(scipy.optimize.brentq(function, low, low + step, xtol=1e-10))
        low += step
    return np.array(roots)


def _along_the_axis(body: Body, basis: ModalBasis) -> tuple[np.ndarray, np.ndarray]:
    """Modes in which the axis of the beam swings sideways, and those in which it stretches; neither: torsion."""
    axis = (np.abs(body.mesh.nodes[:, 1:] - DEPTH / 2) < 1e-9).all(axis=1)
    size = np.linalg.norm(basis.shapes[axis], axis=0)
    sideways, largest = np.linalg.norm(size[1:], axis=0), np.linalg.norm(basis.shapes, axis=(0, 1))
    moved = np.maximum(sideways, size[0]) > 0.05 * largest
    return moved & (sideways > size[0]), moved & (sideways < size[0])


def _beam_checks(frequencies: np.ndarray, targets: np.ndarray) -> list[Check]:
    """Compare the mean of each pair: a square section bends along both axes at the same frequency."""
    pairs = frequencies[: 2 * len(targets)].reshape(-1, 2).mean(axis=1)
    return [
        Check(f"bending {k}", float(f), float(target), BEAM, 0.02, "Hz")
        for k, (f, target) in enumerate(zip(pairs, targets, strict=True), 1)
    ]


def _mass(body: Body, volume: float) -> Check:
    """Sum of the mass matrix, each component counted once, beside density times volume."""
    target = float(body.material.density * volume)
    return Check("sum of the mass matrix", float(body.mass().sum()) / 3, target, "rho V", 1e-12, "kg")
