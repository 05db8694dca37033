"""A rigid sphere on a half-space at finite strain: forces, and the coefficients of the contact law at large strain.

The law adds to Sneddon's force, with `s = sqrt(d/R)` and `E* = E / (1 - nu^2)`,

    4/3 E* R^2 s^3 (q1 s + q2 s^2 + q3 s^3)

The half-space is a cylinder of 2000 radii; the force of a sphere differs from the half-space's by less than 1e-3 there.
A nearly incompressible one has 200 radii, where Newton's method converges. There the surface yields by
`0.4 F / (E* L)` less than on a half-space, `L` being the radius of the cylinder (measured at nu = 0.45).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benches.strain.axisymmetric import Cylinder, DivergedError, Sphere, forces, graded
from benches.strain.materials import Material
from palpate.validation.verify.contact.closed_forms import sneddon_sphere

# Depths over the radius.
DEPTHS = np.array([0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2, 1.35, 1.5])
# Depth that every fit has to reach.
LEAST_DEPTH = 1.2
# Size of elements below the sphere over its radius, and growth of elements outwards.
FINE, GROWTH = 1 / 14, 1.45
# Radius and height of the cylinder over the sphere's radius.
EXTENT = 2000.0
# The same beyond a Poisson's ratio, with coarser elements, and the yielding over `F / (E* L)` that is missing.
NEARLY_INCOMPRESSIBLE, NEAR_EXTENT, COARSER, MISSING = 0.47, 200.0, (1 / 9, 1.4), 0.4
# Least depth that is fitted there, over the radius.
SHALLOWEST = 0.09


def half_space(material: Material, fine: float = FINE, growth: float = GROWTH, extent: float = EXTENT) -> Cylinder:
    """Return a half-space below a sphere of radius 1."""
    r, z = graded(fine, 1.5, growth, extent), graded(fine, 0.75, growth, extent)
    return Cylinder(r, -z, material)


@dataclass(frozen=True)
class Fit:
    """Coefficients of the correction, and the largest relative error of the force over :data:`DEPTHS` from 0.1 on."""

    coefficients: np.ndarray
    error: float


def fit(material: Material, depths: Sequence[float], found: np.ndarray, shallowest: float = 0.04) -> Fit:
    """Fit the correction to forces on a half-space under a sphere of radius 1."""
    depths = np.asarray(depths)[: len(found)]
    if depths[-1] < LEAST_DEPTH:
        raise DivergedError(f"no solution beyond a depth of {depths[-1]:g} radii")
    modulus = material.youngs_modulus / (1.0 - material.poissons_ratio**2)
    linear = np.array([sneddon_sphere(depth, 1.0, modulus)[0] for depth in depths])
    s = np.sqrt(depths)
    terms = 4.0 / 3.0 * modulus * (s**3)[:, None] * np.stack([s, s**2, s**3], 1)
    used = depths >= shallowest
    weighted = terms[used] / found[used, None]
    coefficients = np.linalg.lstsq(weighted, (found - linear)[used] / found[used], rcond=None)[0]
    error = np.abs((linear + terms @ coefficients) / found - 1.0)[used].max()
    return Fit(coefficients, float(error))


def coefficients(material: Material) -> Fit:
    """Press a sphere into a half-space of the material and fit the correction."""
    if material.poissons_ratio <= NEARLY_INCOMPRESSIBLE:
        return fit(material, DEPTHS, forces(half_space(material), Sphere(1.0), DEPTHS))
    steps = np.unique(np.concatenate([DEPTHS, np.arange(0.1, DEPTHS[-1], 0.075)]))
    found = forces(half_space(material, *COARSER, NEAR_EXTENT), Sphere(1.0), steps)
    found = found[np.isin(steps[: len(found)], DEPTHS)]
    modulus = material.youngs_modulus / (1.0 - material.poissons_ratio**2)
    missing = MISSING * found / (modulus * NEAR_EXTENT)
    return fit(material, DEPTHS, found - np.gradient(found, DEPTHS[: len(found)]) * missing, SHALLOWEST)
