"""Inputs of scripted runs: paths of the tools, strikes, watched nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate import units
from palpate.errors import SceneError
from palpate.vectors import number_array, three_numbers

# How far from one the length of an orientation may be.
UNIT_LENGTH = 1e-6


def positions_of(positions: Any, tools: int) -> np.ndarray:
    """Positions (t, tools, 3), m, from those of the first tool (t, 3) or of some tools (t, some, 3).

    Raises SceneError for another shape, no tick, more tools than the scene has, or infinite positions.
    """
    path = number_array(positions, "positions", SceneError)
    if path.ndim not in (2, 3) or path.shape[-1] != 3 or path.size == 0:
        raise SceneError(f"positions must have shape (ticks, 3) or (ticks, tools, 3), got {path.shape}")
    path = path[:, None] if path.ndim == 2 else path
    if path.shape[1] > tools:
        raise SceneError(f"positions of {path.shape[1]} tools, the scene has {tools}")
    infinite = np.argwhere(np.isinf(path).any(axis=(1, 2)))
    if len(infinite):
        raise SceneError(f"position {infinite[0, 0]} is infinite; NaN takes a tool out of the scene")
    return path


def orientations_of(orientations: Any, positions: np.ndarray) -> np.ndarray:
    """Check unit quaternions w x y z (t, tools, 4) for positions (t, tools, 3); None does not turn the tools.

    Raises SceneError for another shape, or a quaternion of a tool in the scene that is not of length one.
    """
    shape = (*positions.shape[:2], 4)
    if orientations is None:
        return np.broadcast_to([1.0, 0.0, 0.0, 0.0], shape).copy()
    turned = number_array(orientations, "orientations", SceneError)
    turned = turned[:, None] if turned.ndim == 2 else turned
    if turned.shape != shape:
        raise SceneError(f"orientations must have shape {shape}, as the positions, got {turned.shape}")
    present = np.isfinite(positions).all(axis=2)
    require_unit_length(turned, present, "at tick")
    return turned


def require_unit_length(orientations: np.ndarray, present: np.ndarray, row: str) -> None:
    """Refuse quaternions (r, tools, 4) of tools in the scene (r, tools) that are not of length one."""
    bad = np.argwhere(present & ~(np.abs(np.linalg.norm(orientations, axis=2) - 1.0) <= UNIT_LENGTH))
    if len(bad):
        number, tool = bad[0]
        raise SceneError(f"the orientation of tool {tool} {row} {number} is not a unit quaternion w x y z")


def grabs_of(grabs: Any, positions: np.ndarray) -> np.ndarray:
    """Whether each tool holds on to what it touches (t, tools); None: never; SceneError for another shape."""
    shape = positions.shape[:2]
    if grabs is None:
        return np.zeros(shape, dtype=bool)
    held = np.ascontiguousarray(grabs, dtype=bool)
    held = held[:, None] if held.ndim == 1 else held
    if held.shape != shape:
        raise SceneError(f"grabs must have shape {shape}, as the positions, got {held.shape}")
    return held


def for_all_tools(
    positions: np.ndarray, orientations: np.ndarray, grabs: np.ndarray, tools: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Add the tools that a script does not speak of, out of the scene: (t, tools, 3), (t, tools, 4), (t, tools)."""
    ticks, given = positions.shape[:2]
    out = np.full((ticks, tools - given, 3), np.nan)
    upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (ticks, tools - given, 4))
    free = np.zeros((ticks, tools - given), dtype=bool)
    added = ((positions, out), (orientations, upright), (grabs, free))
    path, turned, held = (np.concatenate(pair, axis=1) for pair in added)
    return path, turned, held


def strike_of(
    point: Sequence[float | str], impulse: Sequence[float], duration: float | str = 0.0
) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Point (m), impulse (N s) and duration (s) of a strike.

    Raises SceneError for numbers that are not finite, or a duration below zero.
    """
    seconds = units.time(duration)
    if not (np.isfinite(seconds) and seconds >= 0):
        raise SceneError(f"a strike's duration must be a time of at least 0 s, got {seconds:g}")
    where = three_numbers(point, "a strike's point", SceneError, units.length)
    return where, three_numbers(impulse, "a strike's impulse", SceneError), seconds
