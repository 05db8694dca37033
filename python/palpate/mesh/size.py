"""Size of a body, and whether the unit of length of its file was meant."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from palpate.errors import MeshWarning, UnclearUnitError
from palpate.units import LENGTH_UNITS, length_scale

# What is felt with a hand or a finger lies well within, m.
LEAST_SIZE, MOST_SIZE = 1e-3, 3.0
# Units that modelling programs write, most common first.
COMMON_UNITS = ("mm", "cm", "m", "in", "um")


def size_text(extents: Sequence[float] | np.ndarray) -> str:
    """Write the sides of a body, m, in the unit that suits the longest: ``80 x 50 x 50 mm``."""
    largest = float(np.max(extents))
    unit = "um" if largest < LEAST_SIZE else "m" if largest > MOST_SIZE else "mm"
    return f"{' x '.join(f'{side / LENGTH_UNITS[unit]:.4g}' for side in extents)} {unit}"


def units_of_size(positions: np.ndarray) -> list[str]:
    """Units of length that positions (k, 3) of a file may be in, most common first: metres alone where these fit.

    None where the body is of no likely size in any unit.
    """
    extents = np.ptp(positions, axis=0) if len(positions) else np.zeros(3)
    return ["m"] if _is_likely(extents) else [u for u in COMMON_UNITS if _is_likely(LENGTH_UNITS[u] * extents)]


def _is_likely(extents: np.ndarray) -> bool:
    """Whether sides, m, are those of a body that is felt; what has no size, or none that is finite, is not judged."""
    longest = float(extents.max())
    return not np.isfinite(longest) or longest <= 0 or LEAST_SIZE <= longest <= MOST_SIZE


def scale_of(name: str, positions: np.ndarray, unit: str | None) -> float:
    """Metres in the unit of length of a file, which is metres if none is given; ``positions`` (k, 3) are in its unit.

    Raises UnitError for a unit that is not a length. Without one UnclearUnitError is raised, where in metres the body
    is not between a millimetre and three metres long.
    """
    scale = length_scale("m" if unit is None else unit)
    extents = np.ptp(positions, axis=0) if len(positions) else np.zeros(3)
    if _is_likely(scale * extents):
        return scale
    size = size_text(scale * extents)
    if unit is not None:
        warnings.warn(f"{name}: the body is {size}; is its unit of length really {unit}?", MeshWarning, stacklevel=4)
        return scale
    fitting = units_of_size(positions)
    choices = " or ".join(f"{u} ({size_text(LENGTH_UNITS[u] * extents)})" for u in fitting) or "any"
    example = fitting[0] if fitting else "m"
    raise UnclearUnitError(
        f"{name}: in metres the body is {size}; which unit of length was meant, {choices}? Give it by --unit "
        f"{example}, or unit = '{example}'",
        fitting,
    )
