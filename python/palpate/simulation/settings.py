"""Checks of settings that are changed while the loop runs: numbers in SI, or text with a unit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from palpate import units
from palpate.errors import SceneError
from palpate.scene import MOST_FRICTION
from palpate.vectors import number

Check = tuple[Callable[[Any], float], Callable[[float], bool], str]


def _plain(what: str) -> Callable[[Any], float]:
    return lambda value: number(value, what, SceneError)


# By name: how a value is read, whether it is within its range, and what is said of one that is not.
_CHECKS: dict[str, Check] = {
    "contact_radius": (units.length, lambda x: x >= 0, "the contact radius must not be negative, got {:g} m"),
    "youngs_modulus": (units.pressure, lambda x: x > 0, "Young's modulus must be positive, got {:g} Pa"),
    "friction": (
        _plain("friction"),
        lambda x: 0 <= x <= MOST_FRICTION,
        f"friction must lie between 0 and {MOST_FRICTION:g}, got {{:g}}",
    ),
    "strain_limit": (
        _plain("the limit of strain"),
        lambda x: 0 <= x <= 1,
        "the limit of strain must lie in [0, 1], got {:g}",
    ),
    "time_scale": (_plain("the time scale"), lambda x: 0 < x <= 1, "the time scale must lie in (0, 1], got {:g}"),
}


def checked(name: str, value: Any) -> float:
    """Value of a setting; of one without a range of its own any finite number.

    Raises SceneError for a value that is no number, or out of its range.
    """
    read, holds, refused = _CHECKS.get(name, (_plain(name), lambda x: True, ""))
    checked = read(value)
    if not (np.isfinite(checked) and holds(checked)):
        raise SceneError(refused.format(checked))
    return checked
