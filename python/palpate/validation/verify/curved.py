"""Curved bodies with elements that follow them: NAFEMS LE10 and Lame's thick sphere."""

from __future__ import annotations

import numpy as np

from palpate.body import Body, Loads, Material
from palpate.fields import StressRecovery
from palpate.mesh import TetMesh
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.grids import lattice, mapped, spherical
from palpate.validation.verify.solution import at_node, surface_response

LAME = "Lame's thick sphere"


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
