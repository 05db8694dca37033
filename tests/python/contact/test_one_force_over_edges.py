"""A sphere at a pose over an edge has one force, however it came there: carried, pressed slowly or in two ticks."""

from __future__ import annotations

import numpy as np
import pytest
from crossings import RADII, UP, Loops, played, polyline
from scipy.spatial.transform import Rotation

RADIUS, STEP = RADII["sphere"], 20e-6
TOP = np.array([0.08, 0.0247, 0.05])
# Offsets from the edge, m, outwards over the air.
BESIDE = np.arange(-6e-3, 4.1e-3, 1e-3)
# Of the largest force.
TOLERANCE = 0.02


def forces_at(loops: Loops, path: np.ndarray) -> np.ndarray:
    return played(loops.loop("block", "sphere"), path, Rotation.identity()).forces


def place(beside: float, deep: float) -> np.ndarray:
    return TOP + [beside, 0.0, RADIUS - deep]


def pressed(loops: Loops, beside: float, deep: float) -> np.ndarray:
    low = place(beside, deep)
    return forces_at(loops, polyline([low + (deep + 1e-3) * UP, low], STEP))[-1]


@pytest.mark.quick(2)
@pytest.mark.parametrize("part", [0.25, 0.5])
def test_a_sphere_that_is_carried_over_an_edge_has_the_force_of_a_press(loops, part):
    deep = part * RADIUS
    start, end = place(BESIDE[0], deep), place(BESIDE[-1], deep)
    path = polyline([start + (deep + 1e-3) * UP, start, end], STEP)
    carried = forces_at(loops, path)
    across = np.flatnonzero(path[:, 2] <= start[2] + 1e-9)
    found = carried[[across[np.abs(path[across, 0] - TOP[0] - beside).argmin()] for beside in BESIDE]]
    straight = np.array([pressed(loops, beside, deep) for beside in BESIDE])
    most = np.linalg.norm(straight, axis=1).max()
    assert np.linalg.norm(found - straight, axis=1).max() <= TOLERANCE * most, np.round(1e3 * (found - straight), 1)


@pytest.mark.parametrize("beside", [0.5e-3, 1e-3, 2e-3])
def test_a_fast_press_on_an_edge_has_the_force_of_a_slow_one(loops, beside):
    deep = 0.5 * RADIUS
    low = place(beside, deep)
    fast = forces_at(loops, np.vstack([np.tile(low + (deep + 1e-3) * UP, (5, 1)), np.tile(low, (100, 1))]))[-1]
    slow = pressed(loops, beside, deep)
    assert np.linalg.norm(slow) > 0.05
    assert np.linalg.norm(fast - slow) <= 1e-3 * np.linalg.norm(slow), (fast, slow)
