"""Undersides of rigid tools: height over the lowest point, m, at places (n, 2), m, of the plane; may be infinite."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Gap = Callable[[np.ndarray], np.ndarray]


def sphere(radius: float, centre: tuple[float, float] = (0.0, 0.0)) -> Gap:
    """`R - sqrt(R^2 - r^2)` below the equator."""
    return ellipsoid((radius, radius, radius), centre)


def ellipsoid(semi_axes: tuple[float, float, float], centre: tuple[float, float] = (0.0, 0.0)) -> Gap:
    """`c (1 - sqrt(1 - x^2/a^2 - y^2/b^2))`."""
    a, b, c = semi_axes

    def gap(places: np.ndarray) -> np.ndarray:
        x, y = (places - centre).T
        inside = 1 - (x / a) ** 2 - (y / b) ** 2
        return np.where(inside > 0, c * (1 - np.sqrt(np.maximum(inside, 0.0))), np.inf)

    return gap


def rounded_punch(radius: float, rounding: float) -> Gap:
    """Flat out to `radius - rounding`, then a quarter of a circle."""

    def gap(places: np.ndarray) -> np.ndarray:
        out = np.maximum(np.linalg.norm(places, axis=1) - (radius - rounding), 0.0)
        inside = rounding**2 - out**2
        return np.where(inside > 0, rounding - np.sqrt(np.maximum(inside, 0.0)), np.inf)

    return gap
