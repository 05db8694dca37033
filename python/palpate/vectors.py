"""The one check of vectors that users give, and how they are printed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from palpate.errors import Error


def three_numbers(values: Any, what: str, error: type[Error]) -> tuple[float, float, float]:
    """Take three finite numbers; ``what`` names them in messages.

    Raises
    ------
    Error
        Of the class ``error``: anything else.

    """
    x, y, z = three_components(values, what, error)
    if x is None or y is None or z is None:
        raise error(f"{what} needs three numbers")
    return x, y, z


def three_components(values: Any, what: str, error: type[Error]) -> tuple[float | None, float | None, float | None]:
    """Take three components, each a finite number or None; ``what`` names them in messages.

    Raises
    ------
    Error
        Of the class ``error``: anything else.

    """
    if not isinstance(values, Iterable):
        raise error(f"{what} needs three numbers")
    given = list(values)
    if not all(v is None or (isinstance(v, Real) and not isinstance(v, (bool, np.bool_))) for v in given):
        raise error(f"{what} needs three numbers")
    if len(given) != 3:
        raise error(f"{what} needs three numbers, got {len(given)}")
    if not all(v is None or np.isfinite(v) for v in given):
        raise error(f"{what} has a number that is not finite")
    x, y, z = (None if v is None else float(v) for v in given)
    return x, y, z


def brief(values: Iterable[float]) -> str:
    """Write numbers to four digits, such as ``[0.012, 0, -1.5]``."""
    return f"[{', '.join(f'{value:.4g}' for value in values)}]"


def rotated(vectors: np.ndarray, orientation: Sequence[float]) -> np.ndarray:
    """Rotate vectors (..., 3) by a unit quaternion `w + v`: `p + 2 v x (v x p + w p)`."""
    w, v = orientation[0], np.array(orientation[1:])
    vectors = np.asarray(vectors, dtype=float)
    return vectors + 2.0 * np.cross(v, np.cross(v, vectors) + w * vectors)


def conjugate(orientation: Sequence[float]) -> tuple[float, float, float, float]:
    """Turn back what a unit quaternion w x y z turns."""
    w, x, y, z = orientation
    return w, -x, -y, -z
