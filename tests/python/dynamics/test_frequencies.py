"""The theory behind the benchmarks of frequencies, and free bodies of 10-node tetrahedra."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import bent, box_mesh

import palpate
from palpate.validation.verify import vibration


@pytest.mark.parametrize(
    ("end", "roots"),
    [("clamped", (1.875104, 4.694091, 7.854757)), ("free", (4.730041, 7.853205, 10.995608))],
)
def test_a_slender_beam_of_timoshenko_is_one_of_euler(end, roots):
    length, depth = 1.0, 1e-3
    young, density = vibration.RUBBER.youngs_modulus, vibration.RUBBER.density
    euler = np.array(roots) ** 2 * np.sqrt(young * depth**2 / 12 / density) / length**2 / (2 * np.pi)
    assert vibration.timoshenko_frequencies(end, 3, length, depth) == pytest.approx(euler, rel=1e-4)
    # Shear and rotatory inertia only ever make a beam slower, the more so the shorter its waves.
    part = vibration.timoshenko_frequencies(end, 3, length, length / 10) / (euler * length / 10 / depth)
    assert (np.diff(part) < 0).all()
    assert (part < 1).all()


def test_a_thick_plate_is_slower_than_a_thin_one():
    """Kirchhoff: `(pi / 2) (m^2 + n^2) / a^2 sqrt(D / (rho h))`; the NAFEMS closed form lies between."""
    young, nu, density = 200e9, 0.3, 8000.0
    bending = young / (12 * (1 - nu**2))
    for waves, target in vibration.PLATE_BENDING.items():
        thin = np.pi / 2 * (waves[0] ** 2 + waves[1] ** 2) / 100 * np.sqrt(bending / density)
        assert target < vibration.plate_frequency(waves, target) < thin


@pytest.mark.parametrize("shape", [lambda mesh: mesh, bent], ids=["straight", "curved"])
def test_an_irregular_free_body_keeps_its_rigid_motions(shape):
    mesh = shape(box_mesh((3, 2, 2)).to_quadratic())
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45, 900.0))
    basis = palpate.modes(body, 8)
    assert np.array_equal(basis.frequencies[:6], np.zeros(6))
    assert basis.frequencies[6] > 1.0
    assert body.mass().sum() == pytest.approx(3 * body.mass(lumped=True).diagonal()[::3].sum(), rel=1e-12)
