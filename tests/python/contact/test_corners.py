"""Spheres pressed on the corner of a block, beside a direct solution of a fine mesh, and deep into it."""

from __future__ import annotations

import numpy as np
import pytest
from crossings import LYING, RADII, UP, Loops, lowest, played, polyline
from scipy.spatial.transform import Rotation

from palpate.validation.verify.contact.measures import given_out

CORNER = np.array([0.08, 0.05, 0.05])
STEP = 20e-6
# Against the way of the press: a corner is pressed straight down, along its diagonal, and obliquely from both sides.
WAYS = {
    "down": UP,
    "diagonal": np.ones(3) / np.sqrt(3),
    "from one side": np.array([1.0, 0.0, 2.0]) / np.sqrt(5),
    "from outside": np.array([1.0, 1.0, 4.0]) / np.sqrt(18),
    "from inside": np.array([-1.0, -1.0, 4.0]) / np.sqrt(18),
}
# Along the way, N, at these depths, m, of a sphere of 6 mm, by `corner_block` with elements of 1.2 mm.
DEPTHS = (1e-3, 2e-3, 3e-3)
DIRECT = {
    "down": (8.37e-3, 25.34e-3, 47.85e-3),
    "diagonal": (4.65e-3, 17.52e-3, 37.15e-3),
    "from one side": (6.74e-3, 22.23e-3, 43.72e-3),
    "from outside": (5.30e-3, 20.33e-3, 42.75e-3),
    "from inside": (17.59e-3, 35.68e-3, 54.87e-3),
}
# Largest difference from it.
TOLERANCE = {"down": 0.11, "diagonal": 0.18, "from one side": 0.40, "from outside": 0.39, "from inside": 0.04}

# Part of its largest force that a tool keeps at the least while it is driven in and slides off to a side.
LEFT = 0.3


def pressed(loops: Loops, tool: str, way: np.ndarray, deep: float, rotation: Rotation) -> tuple[np.ndarray, np.ndarray]:
    """Depths (t,), m, and forces (t, 3), N, of a press on the corner."""
    start, depths = CORNER - lowest(tool, rotation, way), np.arange(-0.3e-3, deep + STEP / 2, STEP)
    return depths, played(loops.loop("block", tool), start - depths[:, None] * way, rotation).forces


@pytest.mark.parametrize("name", WAYS)
def test_a_sphere_on_a_corner_feels_what_the_direct_solution_does(loops, name):
    depths, forces = pressed(loops, "sphere", WAYS[name], DEPTHS[-1], Rotation.identity())
    along = forces[np.searchsorted(depths, np.array(DEPTHS) - STEP / 2)] @ WAYS[name]
    off = along / np.array(DIRECT[name]) - 1
    assert np.abs(off).max() <= TOLERANCE[name], np.round(100 * off, 1)


@pytest.mark.quick(5)
@pytest.mark.parametrize("tool", ["sphere", "ellipsoid", "capsule"])
@pytest.mark.parametrize("name", WAYS)
def test_a_tool_that_is_driven_into_a_corner_keeps_its_contact(loops, name, tool):
    """The direct solution slides off at about a radius too: then the force pushes aside, as hard as before."""
    rotation = LYING if tool == "capsule" else Rotation.identity()
    _, forces = pressed(loops, tool, WAYS[name], 2.5 * RADII[tool], rotation)
    size = np.linalg.norm(forces, axis=1)
    assert size.max() > 0.05
    assert (size >= LEFT * np.maximum.accumulate(size)).all()


@pytest.mark.quick(3)
@pytest.mark.parametrize("part", [0.25, 0.5, 1.0])
def test_a_closed_path_over_a_corner_gives_out_no_more_than_was_put_in(loops, part):
    deep, radius = part * RADII["sphere"], RADII["sphere"]
    simulation = loops.loop("block", "sphere")
    for name, beside in (("diagonal", [-8e-3, -8e-3, 0.0]), ("along an edge", [-8e-3, 0.0, 0.0])):
        above = CORNER + [0.0, 0.0, radius + 0.5e-3]
        low = CORNER + [0.0, 0.0, radius - deep]
        there = low + np.array(beside)
        for legs in ([above, low, there, there + (above - low), above], [there + (above - low), there, low, above]):
            path = polyline([*legs, legs[0]] if not np.array_equal(legs[0], legs[-1]) else legs, STEP)
            given, peak = given_out(path[None], played(simulation, path, Rotation.identity()).forces[None])
            assert given[0] <= 1e-3 * peak[0], f"{name}: {100 * given[0] / peak[0]:+.3f} %"
            if part < 1.0:
                # Nor does it lose any: pressure cells would lose 2 % there.
                assert given[0] >= -1e-3 * peak[0], f"{name}: {100 * given[0] / peak[0]:+.3f} %"
