"""Hyperelastic materials by their energy density `W(I1, I2, J)`, with first and second derivatives.

`I1 = tr C` and `I2 = (I1^2 - tr C^2) / 2` are the invariants of `C = F^T F`, and `J = det F`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class Density:
    """Energy density, Pa, and its derivatives, arrays of one shape.

    Attributes
    ----------
    value
        `W`.
    first
        By `I1`, `I2` and `J`.
    second
        By pairs of them, as a nested list that is symmetric.

    """

    value: np.ndarray
    first: list[np.ndarray]
    second: list[list[np.ndarray]]


class Material(Protocol):
    """A material that is isotropic."""

    youngs_modulus: float
    poissons_ratio: float

    def density(self, i1: np.ndarray, i2: np.ndarray, j: np.ndarray) -> Density:
        """Return the energy density at invariants of one shape."""


def shear_modulus(youngs_modulus: float, poissons_ratio: float) -> float:
    """Return `mu`, Pa."""
    return youngs_modulus / (2.0 * (1.0 + poissons_ratio))


@dataclass(frozen=True)
class NeoHookean:
    """`W = mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2` (Bonet and Wood, 2008, eq. 6.27)."""

    youngs_modulus: float = 1.0
    poissons_ratio: float = 0.45

    def density(self, i1: np.ndarray, i2: np.ndarray, j: np.ndarray) -> Density:
        """Return the energy density at invariants of one shape."""
        mu, nu = shear_modulus(self.youngs_modulus, self.poissons_ratio), self.poissons_ratio
        lame = 2.0 * mu * nu / (1.0 - 2.0 * nu)
        log, zero = np.log(j), np.zeros_like(i1)
        value = 0.5 * mu * (i1 - 3.0 - 2.0 * log) + 0.5 * lame * log**2
        by_j, by_jj = (lame * log - mu) / j, (mu + lame - lame * log) / j**2
        second = [[zero, zero, zero], [zero, zero, zero], [zero, zero, by_jj]]
        return Density(value, [np.full_like(i1, 0.5 * mu), zero, by_j], second)


@dataclass(frozen=True)
class ReducedPolynomial:
    """`W = c10 (A - 3) + c20 (A - 3)^2 + c30 (A - 3)^3 + c01 (B - 3) + K/2 (J - 1)^2`.

    Here `A = I1 J^(-2/3)` and `B = I2 J^(-4/3)`.

    Mooney's and Rivlin's material has `c10` and `c01`, Yeoh's `c10`, `c20` and `c30`, as in Abaqus and CalculiX with
    `D1 = 2/K`. Given are ratios: `c10 + c01 = mu/2`.

    Attributes
    ----------
    youngs_modulus, poissons_ratio
        Of small strains.
    share_of_second
        `c01 / (c10 + c01)`.
    quadratic, cubic
        `c20 / c10` and `c30 / c10`.

    """

    youngs_modulus: float = 1.0
    poissons_ratio: float = 0.45
    share_of_second: float = 0.0
    quadratic: float = 0.0
    cubic: float = 0.0

    def coefficients(self) -> dict[str, float]:
        """Return `c10`, `c01`, `c20`, `c30` and `K`, Pa."""
        half = 0.5 * shear_modulus(self.youngs_modulus, self.poissons_ratio)
        c10 = half * (1.0 - self.share_of_second)
        bulk = self.youngs_modulus / (3.0 * (1.0 - 2.0 * self.poissons_ratio))
        return {
            "c10": c10,
            "c01": half * self.share_of_second,
            "c20": c10 * self.quadratic,
            "c30": c10 * self.cubic,
            "bulk": bulk,
        }

    def density(self, i1: np.ndarray, i2: np.ndarray, j: np.ndarray) -> Density:
        """Return the energy density at invariants of one shape."""
        c = self.coefficients()
        a_1, b_2 = j ** (-2 / 3), j ** (-4 / 3)
        a, b = i1 * a_1, i2 * b_2
        x = a - 3.0
        f = c["c10"] * x + c["c20"] * x**2 + c["c30"] * x**3
        f_a, f_aa = c["c10"] + 2 * c["c20"] * x + 3 * c["c30"] * x**2, 2 * c["c20"] + 6 * c["c30"] * x
        a_j, a_1j, a_jj = -2 / 3 * a / j, -2 / 3 * a_1 / j, 10 / 9 * a / j**2
        b_j, b_2j, b_jj = -4 / 3 * b / j, -4 / 3 * b_2 / j, 28 / 9 * b / j**2
        zero, c01 = np.zeros_like(i1), c["c01"]
        first = [f_a * a_1, c01 * b_2, f_a * a_j + c01 * b_j + c["bulk"] * (j - 1.0)]
        by_1j, by_2j = f_aa * a_1 * a_j + f_a * a_1j, c01 * b_2j
        by_jj = f_aa * a_j**2 + f_a * a_jj + c01 * b_jj + c["bulk"]
        second = [[f_aa * a_1**2, zero, by_1j], [zero, zero, by_2j], [by_1j, by_2j, by_jj]]
        return Density(f + c01 * (b - 3.0) + 0.5 * c["bulk"] * (j - 1.0) ** 2, first, second)
