"""Solids at rest: a cantilever, Cook's membrane, and curved bodies whose elements follow them: NAFEMS LE10, Lame."""

from __future__ import annotations

import numpy as np

from palpate.body import Body, Loads, Material
from palpate.fields import StressRecovery
from palpate.mesh import TetMesh
from palpate.validation.verify.benchmark import Check, Outcome, at_node, quiet_body, surface_response
from palpate.validation.verify.exactness import ORDER_NAMES
from palpate.validation.verify.grids import box, lattice, mapped, spherical

# Cantilever of square section, ten times longer than deep, with a force across its tip.
LENGTH, DEPTH, YOUNGS_MODULUS, FORCE = 0.1, 0.01, 1e6, 0.01
BEAM = "beam theory with shear (Cowper 1966)"
COOK = "quadrilaterals of degree 4, extrapolated"
LAME = "Lame's thick sphere"


def cantilever() -> Outcome:
    """Deflect a tip by bending and shear, at a moderate and a high Poisson's ratio."""
    checks = []
    for nu, tolerance in ((0.3, 0.01), (0.49, 0.03)):
        target = 1e3 * _beam_deflection(nu)
        for name, quadratic, hard in (
            ("10 nodes", True, False),
            ("10 nodes, glued", True, True),
            ("4 nodes", False, False),
        ):
            computed = 1e3 * _cantilever_deflection(nu, quadratic, hard)
            judged = tolerance if quadratic and not hard else None
            checks.append(Check(f"tip, nu {nu}, {name}", computed, target, BEAM, judged, "mm"))
    return Outcome(checks)


def cook() -> Outcome:
    """Cook's tapered panel, nearly incompressible, in plane strain: one layer between two planes."""
    checks = []
    for quadratic in (True, False):
        computed = _cook_deflection(24, quadratic)
        title = f"middle of the end, nu 0.4999, {ORDER_NAMES[quadratic]}"
        checks.append(Check(title, computed, 7.41, COOK, 0.03 if quadratic else None))
    return Outcome(checks)


def _beam_deflection(nu: float) -> float:
    """`P L^3 / (3 E I) + P L / (kappa G A)`, Cowper's `kappa = 10 (1 + nu) / (12 + 11 nu)` for a rectangle."""
    inertia, area = DEPTH**4 / 12, DEPTH**2
    kappa, shear = 10 * (1 + nu) / (12 + 11 * nu), YOUNGS_MODULUS / (2 * (1 + nu))
    return FORCE * LENGTH**3 / (3 * YOUNGS_MODULUS * inertia) + FORCE * LENGTH / (kappa * shear * area)


def _cantilever_deflection(nu: float, quadratic: bool, glued: bool) -> float:
    """Deflection with an end that stays plane but may grow wider and thinner, as theory has it, or is glued to a wall.

    Glue fixes the section across too, which makes a beam 1 % stiffer at nu = 0.3 and 3 % at nu = 0.49.
    """
    mesh = box((20, 2, 2), (LENGTH, DEPTH, DEPTH), quadratic=quadratic)
    end, middle = mesh.nodes[:, 0] < 1e-9, np.abs(mesh.nodes - DEPTH / 2) < 1e-9
    fixed = np.column_stack([end, end & (glued | middle[:, 1]), end & (glued | middle[:, 2])])
    loads = Loads(spread=[(lambda p: p[:, 0] > LENGTH - 1e-9, (0, 0, FORCE))])
    body = quiet_body(mesh, Material(YOUNGS_MODULUS, nu), fixed, loads)
    return float(surface_response(body)[at_node(mesh, (LENGTH, DEPTH / 2, DEPTH / 2)), 2])


def _cook_deflection(cells: int, quadratic: bool) -> float:
    """Corners (0, 0), (48, 44), (48, 60), (0, 44), thickness 1, E = 250, total shear force 100 on the end."""

    def panel(coordinates: np.ndarray) -> np.ndarray:
        s, t, z = coordinates.T
        return np.column_stack([48 * s, 44 * s + t * (44 - 28 * s), z])

    side = np.linspace(0, 1, cells + 1)
    mesh = mapped(lattice(side, side, np.array([0.0, 1.0])), panel, quadratic=quadratic)
    fixed = np.zeros(mesh.nodes.shape, dtype=bool)
    fixed[:, 2] = (mesh.nodes[:, 2] < 1e-9) | (mesh.nodes[:, 2] > 1 - 1e-9)
    fixed[mesh.nodes[:, 0] < 1e-9] = True
    loads = Loads(spread=[(lambda p: p[:, 0] > 48 - 1e-9, (0, 100, 0))])
    body = quiet_body(mesh, Material(250.0, 0.4999), fixed, loads)
    return float(surface_response(body)[at_node(mesh, (48, 52, 0)), 1])


def thick_plate() -> Outcome:
    """NAFEMS LE10: a quarter of a thick elliptic plate with an elliptic hole, loaded by 1 MPa on its top."""
    mesh = _elliptic_plate((6, 10, 4))
    x, y, z = mesh.nodes.T
    outer = (x / 3.25) ** 2 + (y / 2.75) ** 2 > 1 - 1e-6
    fixed = np.zeros(mesh.nodes.shape, dtype=bool)
    fixed[:, 0] = (x < 1e-9) | outer
    fixed[:, 1] = (y < 1e-9) | outer
    fixed[:, 2] = outer & (np.abs(z) < 1e-9)
    loads = Loads(pressure=[(z > 0.3 - 1e-9, 1e6)])
    body = Body(mesh, material=Material(210e9, 0.3), fixed=fixed, loads=loads)
    field = StressRecovery(body).recover(surface_response(body))
    stress = field.stress[at_node(mesh, (2.0, 0.0, 0.3)), 1, 1]
    return Outcome([Check("stress yy at D, 10 nodes", 1e-6 * stress, -5.38, "NAFEMS LE10", 0.02, "MPa")])


def thick_sphere() -> Outcome:
    """Lame: an octant of a sphere, twice as wide as its hole, under pressure in the hole."""
    inner, outer, pressure, material = 0.02, 0.04, 1e3, Material(1e4, 0.3)
    quarter = np.linspace(0, np.pi / 2, 9)
    radii = inner + (outer - inner) * np.linspace(0, 1, 9) ** 2.5  # fine at the hole, where stress is read
    mesh = mapped(lattice(radii, quarter, quarter), spherical, quadratic=True)
    loads = Loads(pressure=[(lambda p: np.linalg.norm(p, axis=1) < 1.001 * inner, pressure)])
    body = Body(mesh, material=material, fixed=mesh.nodes < 1e-9, loads=loads)
    u = surface_response(body)

    x = mesh.nodes[mesh.surface_nodes]
    r = np.linalg.norm(x, axis=1)
    e, nu = material.youngs_modulus, material.poissons_ratio
    scale = pressure * inner**3 / (outer**3 - inner**3)
    exact = (scale * r / e * ((1 - 2 * nu) + (1 + nu) * outer**3 / (2 * r**3)))[:, None] * x / r[:, None]
    off = np.abs(u - exact).max() / np.abs(exact).max()
    stress = StressRecovery(body).recover(u).stress
    radial = np.einsum("ni,nij,nj->n", x, stress, x) / r**2
    hoop = (np.trace(stress, axis1=1, axis2=2) - radial) / 2
    hole = r < 1.001 * inner
    exact_hoop = scale * (1 + outer**3 / (2 * inner**3))
    return Outcome(
        [
            Check("displacement, largest error over the largest", float(off), 0.0, LAME, 0.01),
            Check("hoop stress in the hole, mean", *_kilopascals(hoop[hole].mean(), exact_hoop), LAME, 0.02, "kPa"),
            Check("radial stress in the hole, mean", *_kilopascals(radial[hole].mean(), -pressure), LAME, 0.02, "kPa"),
        ]
    )


def _elliptic_plate(cells: tuple[int, int, int]) -> TetMesh:
    """Between ellipses of semi-axes 2, 1 m and 3.25, 2.75 m, 0.6 m thick, z from its middle; finer at the hole."""

    def place(coordinates: np.ndarray) -> np.ndarray:
        s, angle, z = coordinates.T
        return np.column_stack([(2 + 1.25 * s) * np.cos(angle), (1 + 1.75 * s) * np.sin(angle), z])

    across, around, up = (np.linspace(0, 1, count + 1) for count in cells)
    return mapped(lattice(across**1.5, np.pi / 2 * around**1.3, 0.6 * up - 0.3), place, quadratic=True)


def _kilopascals(*values: float) -> tuple[float, ...]:
    return tuple(1e-3 * float(value) for value in values)
