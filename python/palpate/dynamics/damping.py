"""Rayleigh damping from damping ratios."""

from __future__ import annotations

import numpy as np

from palpate.errors import BodyError


def rayleigh_from_ratios(xi1: float, f1: float, xi2: float, f2: float) -> tuple[float, float]:
    """Factors of `B = a M + b K` that give two frequencies their damping ratios.

    A mode of angular frequency `w` has the ratio `xi = a / (2 w) + b w / 2`; two of them are two equations for a and b.

    Parameters
    ----------
    xi1, f1
        Ratio to critical damping at the frequency f1, Hz.
    xi2, f2
        The same at another frequency.

    Returns
    -------
    tuple[float, float]
        a in 1/s and b in s.

    Raises
    ------
    BodyError
        Equal or non-positive frequencies, or ratios so far apart that a factor would be negative.

    """
    values = (xi1, f1, xi2, f2)
    if not all(np.isfinite(v) for v in values) or min(f1, f2) <= 0 or f1 == f2 or min(xi1, xi2) < 0:
        raise BodyError(f"two different positive frequencies and two ratios of at least 0 are needed, got {values}")
    w1, w2 = 2 * np.pi * f1, 2 * np.pi * f2
    difference = w2**2 - w1**2
    a = 2 * w1 * w2 * (xi1 * w2 - xi2 * w1) / difference
    b = 2 * (xi2 * w2 - xi1 * w1) / difference
    if min(a, b) < 0:
        low, high = sorted((f1 / f2, f2 / f1))
        raise BodyError(
            f"ratios of {xi1} at {f1} Hz and {xi2} at {f2} Hz need a negative factor, which would add energy "
            f"at other frequencies: the quotient of the ratios must lie between {low:.4g} and {high:.4g}"
        )
    return float(a), float(b)
