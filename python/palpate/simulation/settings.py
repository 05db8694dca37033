"""Checks of what a person changes while the loop runs: numbers in SI, or text with a unit."""

from __future__ import annotations

import numpy as np

from palpate import units
from palpate.errors import SceneError
from palpate.scene import MOST_FRICTION
from palpate.vectors import number


def checked_radius(value: float | str) -> float:
    """Contact radius, m.

    Raises
    ------
    SceneError
        A negative number, or one that is not finite.

    """
    radius = units.length(value)
    if not (np.isfinite(radius) and radius >= 0):
        raise SceneError(f"the contact radius must not be negative, got {radius:g} m")
    return radius


def checked_modulus(value: float | str) -> float:
    """Young's modulus, Pa.

    Raises
    ------
    SceneError
        A number that is not positive, or not finite.

    """
    modulus = units.pressure(value)
    if not (np.isfinite(modulus) and modulus > 0):
        raise SceneError(f"Young's modulus must be positive, got {modulus:g} Pa")
    return modulus


def checked_friction(value: float) -> float:
    """Coulomb's coefficient of friction.

    Raises
    ------
    SceneError
        A coefficient that is negative, or too large for any pair of materials.

    """
    friction = number(value, "friction", SceneError)
    if not 0.0 <= friction <= MOST_FRICTION:
        raise SceneError(f"friction must lie between 0 and {MOST_FRICTION:g}, got {friction:g}")
    return friction


def checked_strain_limit(value: float) -> float:
    """Largest strain to which tools take a body; 0 for none.

    Raises
    ------
    SceneError
        A limit below 0 or above 1.

    """
    limit = number(value, "the limit of strain", SceneError)
    if not 0.0 <= limit <= 1.0:
        raise SceneError(f"the limit of strain must lie in [0, 1], got {limit:g}")
    return limit


def checked_time_scale(value: float) -> float:
    """Seconds that bodies in motion advance in a second.

    Raises
    ------
    SceneError
        A scale outside of (0, 1].

    """
    scale = number(value, "the time scale", SceneError)
    if not 0 < scale <= 1:
        raise SceneError(f"the time scale must lie in (0, 1], got {scale:g}")
    return scale
