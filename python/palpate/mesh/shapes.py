"""Simple solids that place a region in a mesh: each is a function of (n, 3) positions, m, that says which lie inside.

Any function of that kind serves as well. An element belongs to a solid if its centroid does, so a region follows the
elements, not the solid's own surface: refine the mesh there if that matters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from palpate import units
from palpate.errors import MeshError
from palpate.vectors import three_numbers

Shape = Callable[[np.ndarray], np.ndarray]


class Sphere:
    """Ball of a ``radius``, m, around its ``center`` (3,), m."""

    def __init__(self, center: Sequence[float], radius: float):
        self.center = _point(center, "the centre of a sphere")
        self.radius = _positive(radius, "the radius of a sphere")

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Whether each point lies inside."""
        return np.linalg.norm(points - self.center, axis=1) <= self.radius


class Box:
    """Block along the axes, from its corner ``low`` to its corner ``high`` (3,), m."""

    def __init__(self, low: Sequence[float], high: Sequence[float]):
        self.low, self.high = _point(low, "the low corner of a box"), _point(high, "the high corner of a box")
        if not (self.low < self.high).all():
            raise MeshError(f"a box must reach from its low to its high corner, got {low} and {high}")

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Whether each point lies inside."""
        return ((points >= self.low) & (points <= self.high)).all(axis=1)


class Cylinder:
    """Round bar of a ``radius``, m, with flat ends, along the line from ``start`` to ``end`` (3,), m."""

    def __init__(self, start: Sequence[float], end: Sequence[float], radius: float):
        self.start, self.end = _point(start, "the start of a cylinder"), _point(end, "the end of a cylinder")
        self.radius = _positive(radius, "the radius of a cylinder")
        if np.array_equal(self.start, self.end):
            raise MeshError("a cylinder must have a length: its start and end are the same")

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Whether each point lies inside."""
        axis = self.end - self.start
        along = (points - self.start) @ axis / (axis @ axis)
        across = points - self.start - along[:, None] * axis
        return (along >= 0) & (along <= 1) & (np.linalg.norm(across, axis=1) <= self.radius)


class HalfSpace:
    """All behind the plane through a ``point`` (3,), m, whose ``normal`` (3,) points out of the half-space."""

    def __init__(self, point: Sequence[float], normal: Sequence[float]):
        self.point, self.normal = (
            _point(point, "the point of a half-space"),
            _point(normal, "the normal of a half-space"),
        )
        if not self.normal.any():
            raise MeshError("the normal of a half-space must have a direction")

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Whether each point lies inside."""
        return (points - self.point) @ self.normal <= 0


def elements_inside(shape: Shape, nodes: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Mask of the elements (m,) whose centroid lies in a solid.

    Raises MeshError if none does, or if a function returns anything but a mask.
    """
    inside = np.asarray(shape(nodes[tets[:, :4]].mean(axis=1)))
    if inside.shape != (len(tets),) or inside.dtype != bool:
        raise MeshError(f"a function that places a region must return a boolean mask of length {len(tets)}")
    if not inside.any():
        kind = type(shape).__name__.lower()
        raise MeshError(f"no element has its centroid in the {kind}: it lies outside, or the elements are too large")
    return inside


def _point(values: Any, what: str) -> np.ndarray:
    return np.array(three_numbers(values, what, MeshError, units.length))


def _positive(value: float | str, what: str) -> float:
    size = units.length(value)
    if not (np.isfinite(size) and size > 0):
        raise MeshError(f"{what} must be positive, got {size:g} m")
    return size
