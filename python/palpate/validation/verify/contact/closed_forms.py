"""Contact of a rigid tool with an elastic half-space, in closed form.

Forces in N, lengths in m, moduli in Pa. ``plane_modulus`` is `E* = E / (1 - nu^2)`; for two elastic bodies
`1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2`.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

# Semi-axes closer than this part of each other are those of a circle: the elliptic integrals lose their digits there.
CIRCULAR = 1e-6


def hertz_sphere(depth: float, radius: float, plane_modulus: float) -> float:
    """Force of a sphere taken as a paraboloid, `4/3 E* sqrt(R) d^1.5` (Hertz 1882; Johnson 1985, 4.22)."""
    return 4 / 3 * plane_modulus * np.sqrt(radius) * max(depth, 0.0) ** 1.5


def sneddon_sphere(depth: float, radius: float, plane_modulus: float) -> tuple[float, float]:
    """Force and contact radius of a sphere at any depth (Sneddon 1965, section 6).

    `d = a/2 ln((R + a)/(R - a))`, `F = E* [(R^2 + a^2)/2 ln((R + a)/(R - a)) - a R]`; Hertz as a goes to zero.
    """
    if depth <= 0:
        return 0.0, 0.0
    a = brentq(lambda a: a * np.arctanh(a / radius) - depth, 0.0, radius * (1 - 1e-15), xtol=1e-16)
    if a < 1e-3 * radius:  # the two terms of the force cancel to `a^3`
        return 4 / 3 * plane_modulus * a**3 / radius * (1 + 0.4 * (a / radius) ** 2), a
    return plane_modulus * ((radius**2 + a**2) * np.arctanh(a / radius) - a * radius), a


def hertz_ellipsoid(
    depth: float, radii: tuple[float, float], plane_modulus: float
) -> tuple[float, tuple[float, float]]:
    """Force and semi-axes of the contact of a paraboloid with two radii of curvature (Johnson 1985, 4.26).

    With the gap `A x^2 + B y^2`, `A <= B`, semi-axes a >= b, `e^2 = 1 - b^2/a^2` and complete integrals K(e), E(e),

        A = p0/E* b/(e^2 a^2) (K - E),   B = p0/E* b/(e^2 a^2) (a^2/b^2 E - K),   d = p0/E* b K,   F = 2/3 pi a b p0.

    Parameters
    ----------
    depth
        m.
    radii
        The larger and the smaller radius of curvature of tool and surface together, m.
    plane_modulus
        Pa.

    """
    largest, smallest = max(radii), min(radii)
    if largest / smallest - 1 < CIRCULAR:
        a = np.sqrt(largest * depth)
        return hertz_sphere(depth, largest, plane_modulus), (a, a)

    def curvatures(m: float) -> float:
        """`B/A` of an ellipse with `m = e^2`, less the wanted one."""
        k, e = ellipk(m), ellipe(m)
        return (e / (1 - m) - k) / (k - e) - largest / smallest

    m = brentq(curvatures, CIRCULAR, 1 - 1e-12, xtol=1e-15)
    k, e = ellipk(m), ellipe(m)
    a = np.sqrt(2 * largest * depth * (k - e) / (k * m))
    b = a * np.sqrt(1 - m)
    pressure = plane_modulus * depth / (b * k)
    return 2 / 3 * np.pi * a * b * pressure, (a, b)


def rounded_punch(depth: float, flat: float, rounding: float, plane_modulus: float) -> tuple[float, float]:
    """Force and contact radius of a flat punch whose rim is rounded (Ciavarella 1999, Jaeger 1995).

    Sneddon's integrals `d = a int f'/sqrt(a^2 - r^2) dr`, `F = 2 E* int r^2 f'/sqrt(a^2 - r^2) dr` over the contact, of
    the profile `f = (r - b)^2 / (2 R)` outside of the flat part; with `cos t = b/a`,

        d = a/R (a sin t - b t),   F = 2 E*/R [a^3 (sin t - sin^3 t / 3) - a^2 b/2 (t + sin t cos t)].

    Parameters
    ----------
    depth
        m.
    flat
        Radius b of the flat part, m.
    rounding
        Radius R of the rim's section, m.
    plane_modulus
        Pa.

    """

    def depth_of(a: float) -> float:
        t = np.arccos(flat / a)
        return a / rounding * (a * np.sin(t) - flat * t)

    high = flat + rounding
    while depth_of(high) < depth:
        high *= 2
    a = brentq(lambda a: depth_of(a) - depth, flat, high, xtol=1e-15)
    t = np.arccos(flat / a)
    s = np.sin(t)
    integral = a**3 * (s - s**3 / 3) - a**2 * flat / 2 * (t + s * np.cos(t))
    return 2 * plane_modulus / rounding * integral, a


def mindlin_force(shift: np.ndarray, normal_force: float, friction: float, tangential_stiffness: float) -> np.ndarray:
    """Friction at a sideways shift under a constant normal force (Mindlin 1949; Cattaneo 1938; Johnson 1985, 7.42).

    `Q = mu P [1 - (1 - s/s_max)^1.5]` up to full slip at `s_max = 3 mu P / (2 k_t)`, where `k_t = 8 a G / (2 - nu)` is
    the stiffness of a contact of radius a that sticks.
    """
    full = 1.5 * friction * normal_force / tangential_stiffness
    return friction * normal_force * (1 - (1 - np.clip(np.asarray(shift) / full, 0.0, 1.0)) ** 1.5)


def mindlin_stiffness(contact_radius: float, youngs_modulus: float, poissons_ratio: float) -> float:
    """`k_t = 8 a G / (2 - nu)`, N/m, of a circular contact that sticks (Mindlin 1949)."""
    shear = youngs_modulus / (2 * (1 + poissons_ratio))
    return 8 * contact_radius * shear / (2 - poissons_ratio)
