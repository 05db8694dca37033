"""Closed forms beside each other, numerical integrals, and direct solutions of the contact problem."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from palpate.validation.verify.contact import closed_forms, measures, tools
from palpate.validation.verify.contact.reference import Block, sphere_press

MODULUS = 12e3


def sneddon_integrals(slope, radius, singular=None):
    """Depth and force over `E*` of a profile by its slope: `a int f'/sqrt(a^2-r^2)`, `2 int r^2 f'/sqrt(a^2-r^2)`."""
    # r = a sin t takes the root away.
    depth = quad(lambda t: radius * slope(radius * np.sin(t)), 0, np.pi / 2, points=singular, epsabs=1e-14)[0]
    force = quad(
        lambda t: 2 * (radius * np.sin(t)) ** 2 * slope(radius * np.sin(t)), 0, np.pi / 2, points=singular, epsabs=1e-16
    )[0]
    return depth, force


def test_sneddons_sphere_is_the_integral_over_a_sphere_and_hertz_when_shallow():
    radius, contact = 0.01, 0.006
    depth, force = sneddon_integrals(lambda r: r / np.sqrt(radius**2 - r**2), contact)
    found, a = closed_forms.sneddon_sphere(depth, radius, MODULUS)
    assert found == pytest.approx(MODULUS * force, rel=1e-9)
    assert a == pytest.approx(contact, rel=1e-9)
    shallow = closed_forms.sneddon_sphere(1e-8, radius, MODULUS)[0]
    assert shallow == pytest.approx(closed_forms.hertz_sphere(1e-8, radius, MODULUS), rel=1e-5)


def test_the_rounded_punch_is_the_integral_over_its_profile():
    flat, rounding, contact = 0.004, 0.002, 0.0052
    slope = lambda r: max(r - flat, 0.0) / rounding  # noqa: E731
    depth, force = sneddon_integrals(slope, contact, singular=[np.arcsin(flat / contact)])
    found, a = closed_forms.rounded_punch(depth, flat, rounding, MODULUS)
    assert found == pytest.approx(MODULUS * force, rel=1e-6)
    assert a == pytest.approx(contact, rel=1e-6)


def test_the_elliptical_contact_goes_over_into_the_circular_one_and_meets_its_own_displacement():
    circle = closed_forms.hertz_sphere(1e-3, 0.01, MODULUS)
    nearly, (a, b) = closed_forms.hertz_ellipsoid(1e-3, (0.0101, 0.0099), MODULUS)
    assert nearly == pytest.approx(circle, rel=1e-3)
    assert a / b == pytest.approx((0.0101 / 0.0099) ** (2 / 3), rel=1e-2)  # Johnson 4.30
    # Mean of the gap over the pressure: the centre sinks by the depth, int p / (pi E* r) dA.
    depth, radii = 1e-3, (0.018, 0.008)
    force, (a, b) = closed_forms.hertz_ellipsoid(depth, radii, MODULUS)
    peak = 1.5 * force / (np.pi * a * b)
    # In polar coordinates of the plane the kernel loses its 1/r.
    reach = lambda t: 1 / np.sqrt((np.cos(t) / a) ** 2 + (np.sin(t) / b) ** 2)  # noqa: E731
    sunk = quad(lambda t: peak * reach(t) * np.pi / 4, 0, 2 * np.pi)[0] / (np.pi * MODULUS)
    assert sunk == pytest.approx(depth, rel=1e-9)


def test_mindlins_curve_starts_with_its_stiffness_and_ends_in_full_slip():
    stiffness = closed_forms.mindlin_stiffness(0.003, 10e3, 0.45)
    shift = np.array([1e-9, 1.0])
    start, end = closed_forms.mindlin_force(shift, 0.05, 0.3, stiffness)
    assert start == pytest.approx(stiffness * 1e-9, rel=1e-3)
    assert end == pytest.approx(0.3 * 0.05, rel=1e-12)


@pytest.mark.slow
def test_the_direct_solution_finds_sneddons_force_on_a_deep_block():
    deep = Block((0.4, 0.4, 0.2))
    # The block is finite: it gives less than a half-space by about the contact radius over its height.
    exact, contact = closed_forms.sneddon_sphere(1e-3, 0.01, deep.plane_modulus)
    assert sphere_press(deep, 0.01, 1e-3).force == pytest.approx(exact * (1 + contact / 0.2), rel=0.01)


@pytest.mark.slow
def test_the_direct_solution_of_a_block_is_the_known_one():
    block = Block()
    for depth, known in ((5e-4, 0.0197), (1e-3, 0.0560), (2e-3, 0.157)):
        assert sphere_press(block, 0.01, depth).force == pytest.approx(known, rel=0.02)


@pytest.mark.slow
def test_the_direct_solution_takes_ellipsoids_and_punches():
    deep = Block((0.4, 0.4, 0.2))
    axes, depth = (0.012, 0.008, 0.008), 5e-4
    exact, (a, b) = closed_forms.hertz_ellipsoid(depth, (0.018, 0.008), deep.plane_modulus)
    found = deep.pressed(tools.ellipsoid(axes), [depth], 1.2 * a, 2 * b / 6)[0]
    assert found.force == pytest.approx(exact, rel=0.02)
    exact, a = closed_forms.rounded_punch(depth, 0.004, 0.002, deep.plane_modulus)
    found = deep.pressed(tools.rounded_punch(0.006, 0.002), [depth], 1.2 * a, a / 5)[0]
    assert found.force == pytest.approx(exact, rel=0.04)


def test_rotation_vectors_are_those_of_scipy():
    from scipy.spatial.transform import Rotation

    first, second = Rotation.random(40, random_state=1), Rotation.random(40, random_state=2)
    wxyz = [np.roll(rotation.as_quat(), 1, axis=1) for rotation in (first, second)]
    expected = (second * first.inv()).as_rotvec()
    assert np.abs(measures.rotation_vectors(*wxyz) - expected).max() < 1e-12
