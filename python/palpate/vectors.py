"""The one check of vectors that users give, and how they are printed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from palpate.errors import Error, UnitError
from palpate.units import brief_repr, to_float

# Reads text with a unit, such as palpate.units.length.
Reader = Callable[[Any], float]


def three_numbers(values: Any, what: str, error: type[Error], read: Reader | None = None) -> tuple[float, float, float]:
    """Take three finite numbers, or raise ``error``; ``what`` names them in messages.

    With ``read`` each may be text with a unit.
    """
    x, y, z = three_components(values, what, error, read)
    if x is None or y is None or z is None:
        raise error(f"{what} needs three numbers")
    return x, y, z


def three_components(
    values: Any, what: str, error: type[Error], read: Reader | None = None
) -> tuple[float | None, float | None, float | None]:
    """Take three components, each a finite number or None, or raise ``error``; ``what`` names them in messages.

    With ``read`` each may be text with a unit.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise error(f"{what} needs three numbers")
    given = [_read(v, what, error, read) if read is not None and isinstance(v, str) else v for v in values]
    if not all(v is None or (isinstance(v, Real) and not isinstance(v, (bool, np.bool_))) for v in given):
        raise error(f"{what} needs three numbers")
    if len(given) != 3:
        raise error(f"{what} needs three numbers, got {len(given)}")
    x, y, z = (None if v is None else to_float(v) for v in given)
    if not all(v is None or np.isfinite(v) for v in (x, y, z)):
        raise error(f"{what} has a number that is not finite")
    return x, y, z


def number_array(values: Any, what: str, error: type[Error]) -> np.ndarray:
    """Take values as an array of real numbers, or raise ``error``; ``what`` names them in messages."""
    # Numbers that do not fit into one array are no array of numbers.
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        array = np.asarray(values)
        if array.dtype.kind in "biufO":
            return np.ascontiguousarray(array, dtype=np.float64)
    raise error(f"{what} must be an array of real numbers, got {brief_repr(values)}")


def number(value: Any, what: str, error: type[Error]) -> float:
    """Take a finite number, or raise ``error``; ``what`` names it in messages."""
    if not isinstance(value, Real) or isinstance(value, (bool, np.bool_)) or not np.isfinite(to_float(value)):
        raise error(f"{what} must be a finite number, got {brief_repr(value)}")
    return to_float(value)


def _read(text: str, what: str, error: type[Error], read: Reader) -> float:
    try:
        return read(text)
    except UnitError as mistake:
        raise error(f"{what}: {mistake}") from None


def brief(values: Iterable[float]) -> str:
    """Write numbers to four digits, such as ``[0.012, 0, -1.5]``."""
    return f"[{', '.join(f'{value:.4g}' for value in values)}]"


def place_text(point: Iterable[float], unit: str = "m") -> str:
    """Write a place to four digits, such as ``(0.012, 0, -1.5) m``."""
    return f"({', '.join(f'{value:.4g}' for value in point)}) {unit}"


def rotated(vectors: np.ndarray, orientation: Sequence[float]) -> np.ndarray:
    """Rotate vectors (..., 3) by a unit quaternion `w + v`: `p + 2 v x (v x p + w p)`."""
    w, v = orientation[0], np.array(orientation[1:])
    vectors = np.asarray(vectors, dtype=float)
    return vectors + 2.0 * np.cross(v, np.cross(v, vectors) + w * vectors)


def turning_z_to(directions: np.ndarray) -> np.ndarray:
    """Give the unit quaternions w x y z (..., 4) that turn z to directions (..., 3) by the smallest angle.

    That of no turn for a direction of zero, half a turn about x for one straight down.
    """
    directions = np.asarray(directions, dtype=float)
    x, y, z = np.moveaxis(directions, -1, 0) / np.maximum(np.linalg.norm(directions, axis=-1), np.finfo(float).tiny)
    # (1 + cos, axis sin) is twice the cosine of half the angle times the quaternion.
    turned = np.stack([1.0 + z, -y, x, np.zeros_like(z)], axis=-1)
    turned[z < -1 + 1e-12] = (0.0, 1.0, 0.0, 0.0)
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def conjugate(orientation: Sequence[float]) -> tuple[float, float, float, float]:
    """Turn back what a unit quaternion w x y z turns."""
    w, x, y, z = orientation
    return w, -x, -y, -z
