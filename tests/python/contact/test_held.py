"""A tool that stands still feels a force that stands still, however it has come there."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes

FRICTIONAL = {"contact": "local", "friction": 0.3}
TOOLS = {
    "sphere": (sphere(0.01, 0.3), 0.01),
    "ellipsoid": ({"shape": "ellipsoid", "semi_axes": (0.012, 0.009, 0.008), **FRICTIONAL}, 0.008),
    "punch": ({"shape": "punch", "radius": 0.006, "rounding": 0.001, **FRICTIONAL}, 0.0),
}


@pytest.fixture(scope="module")
def block():
    body = body_on_table(Block(), (8, 8, 4), quadratic=False)
    return body, green_of(body, touch=top_nodes(body))


@pytest.mark.quick(3)
@pytest.mark.parametrize("name", TOOLS)
@pytest.mark.parametrize("come", [(1e-4, 0.0, -1e-4), (3e-5, 2e-5, -1e-5), (0.0, 0.0, -7e-6)])
def test_a_held_force_neither_creeps_nor_jumps(block, name, come):
    """What was left of a step below its tolerance used to be repeated at every tick, and then taken back at once."""
    body, green = block
    tool, height = TOOLS[name]
    low, high = body.mesh.bounds
    end = np.array([*(low + high)[:2] / 2 + (1.3e-3, 0.7e-3), high[2] + height - 1e-3])
    ticks = np.arange(round(2e-3 / abs(come[2])), -1, -1)
    path = np.vstack([end - ticks[:, None] * come, np.tile(end, (1000, 1))])
    held = loop_of(body, green, [tool]).run(path)[-900:]
    assert held[0, 2] > 0.01
    assert np.ptp(held, axis=0).max() < 1e-9 * np.abs(held).max()
