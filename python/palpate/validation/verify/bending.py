"""Bending: a cantilever, and Cook's membrane."""

from __future__ import annotations

import numpy as np

from palpate.body import Loads, Material
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.exactness import ORDER_NAMES
from palpate.validation.verify.grids import box, lattice, mapped
from palpate.validation.verify.solution import at_node, quiet_body, surface_response

# Cantilever of square section, ten times longer than deep, with a force across its tip.
LENGTH, DEPTH, YOUNGS_MODULUS, FORCE = 0.1, 0.01, 1e6, 0.01
BEAM = "beam theory with shear (Cowper 1966)"
COOK = "quadrilaterals of degree 4, extrapolated"


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
