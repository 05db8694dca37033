"""A tool that was out of the scene and comes back inside of a body begins from no force, as after a jump."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes

RADIUS, DEEP = 6e-3, 12e-3
UNFELT = 1e-3


@pytest.fixture(scope="module")
def loop() -> Simulation:
    body = body_on_table(Block(), (8, 8, 4), quadratic=True)
    return loop_of(body, green_of(body, touch=top_nodes(body), precision="f32"), [sphere(RADIUS)])


def path(first: float, away: int, second: float) -> np.ndarray:
    """Origins (t, 3), m: down to a depth, out of the scene for some ticks, and back at another depth for as many."""
    down = np.concatenate([np.arange(-5e-4, first, 5e-5), np.full(away, np.nan), np.full(20, second)])
    return np.array([0.05, 0.05, 0.05 + RADIUS]) - down[:, None] * [0.0, 0.0, 1.0]


@pytest.mark.parametrize("away", [1, 5, 200])
@pytest.mark.parametrize("first", [-4e-4, 2e-3, DEEP])
def test_a_tool_that_comes_back_deep_begins_from_no_force(loop, first, away):
    size = np.linalg.norm(loop.play(path(first, away, DEEP)).computed_forces, axis=1)
    assert size[:-20].max() > 0 or first < 0
    # It rests where it came back.
    assert size[-20:].max() <= UNFELT, f"{size[-20:].max():.3g} N"


def test_it_is_felt_from_there_on(loop):
    """What was refused to it is not a body that is gone: a millimetre farther has a force, within what that has."""
    there = path(2e-3, 5, DEEP)
    farther = there[-1] - np.arange(0, 1e-3, 5e-5)[:, None] * [0.0, 0.0, 1.0]
    size = np.linalg.norm(loop.play(np.vstack([there, farther])).computed_forces, axis=1)
    pressed = np.linalg.norm(loop.play(path(1e-3, 0, 1e-3)).computed_forces, axis=1)
    assert 0.2 * pressed[-1] < size[-1] < 5 * pressed[-1]
