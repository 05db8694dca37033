"""A sphere on a thin layer that is glued to a table, beside a direct solution: how far the law is off, as documented.

The law is a half-space in series with what is regular of the body. A layer thinner than about the tool is no
half-space: docs/accuracy.md has the figures that are held here.
"""

from __future__ import annotations

import time

import numpy as np
import pytest

from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.reference import Block, body_on_table, sphere_press, top_nodes

RADIUS, SIDE, STEP = 8e-3, 0.06, 10e-6
DEPTHS = np.array([0.25e-3, 0.5e-3, 1e-3, 2e-3])
# Thickness, m, and how much less, or more, than the direct solution at most, by the depths above.
LAYERS = {6e-3: (0.12, 0.16, 0.20, 0.22), 12e-3: (0.025, 0.025, 0.025, 0.025), 25e-3: (0.02, 0.02, 0.02, 0.025)}
CELLS = {6e-3: (12, 12, 1), 12e-3: (12, 12, 2), 25e-3: (12, 12, 3)}


def pressed(block: Block, cells: tuple[int, int, int]) -> np.ndarray:
    """Forces of the loop at the depths, N."""
    body = body_on_table(block, cells, quadratic=True)
    loop = loop_of(body, green_of(body, touch=top_nodes(body), precision="f32"), [sphere(RADIUS)])
    down = np.arange(-5e-4, DEPTHS[-1] + STEP / 2, STEP)
    path = np.array([SIDE / 2, SIDE / 2, block.size[2] + RADIUS]) - down[:, None] * [0.0, 0.0, 1.0]
    return loop.play(path).computed_forces[np.searchsorted(down, DEPTHS - STEP / 2), 2]


@pytest.mark.slow
@pytest.mark.parametrize("thickness", LAYERS)
def test_a_layer_feels_as_far_from_the_direct_solution_as_documented(thickness):
    block = Block((SIDE, SIDE, thickness))
    direct = np.array([sphere_press(block, RADIUS, depth).force for depth in DEPTHS])
    off = pressed(block, CELLS[thickness]) / direct - 1
    assert (np.abs(off) <= LAYERS[thickness]).all(), off
    # What is checked can fail: 5 % more are seen where the law is right.
    if thickness > 6e-3:
        assert not (np.abs(1.05 * (off + 1) - 1) <= LAYERS[thickness]).all()


@pytest.mark.parametrize(("thickness", "thin"), [(6e-3, True), (25e-3, False)])
def test_a_frame_flags_a_place_that_is_thinner_than_the_tool(thickness, thin):
    block = Block((SIDE, SIDE, thickness))
    body = body_on_table(block, CELLS[thickness], quadratic=True)
    loop = loop_of(body, green_of(body, touch=top_nodes(body), precision="f32"), [sphere(RADIUS)])
    above = np.array([SIDE / 2, SIDE / 2, thickness + RADIUS])
    with loop:
        loop.move((above + [0, 0, 1e-3]).tolist())
        wait_until(lambda: loop.frame().active[0])
        assert loop.frame().statistics["thin"] == [False]
        loop.move((above - [0, 0, 1e-3]).tolist())
        wait_until(lambda: loop.frame().contacts)
        assert loop.frame().statistics["thin"] == [thin]


def wait_until(holds) -> None:
    """Wait for the loop, 10 s at the most."""
    for _ in range(1000):
        if holds():
            return
        time.sleep(0.01)
    raise AssertionError("the loop did not get there")
