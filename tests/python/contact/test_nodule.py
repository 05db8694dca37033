"""A fingertip over the nodule of the example: how much harder it feels, beside a direct solution of a fine mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.contact import tools
from palpate.validation.verify.contact.loop import UNLIMITED, straight
from palpate.validation.verify.contact.reference import Block, Nodule

EXAMPLE = Path(__file__).parents[3] / "examples" / "nodule.toml"
MIDDLE, TOP, DEPTH = 0.04, 0.04, 1.5e-3
# Young's modulus of the nodule, Pa, and its radius, m: contrasts of about 7, 14 and 28 per cent.
NODULES = ((11e3, 5e-3), (26e3, 5e-3), (13.5e3, 7e-3))
# Edge of the elements of the direct solution under the tool and around the nodule, m.
CELL = 2e-3
# Part of the direct contrast that the tick shows at least. `C_reg` is that of a patch of 1.6 radii of the tool,
# here 8 mm, wider than these nodules are deep (3 and 5 mm): it spreads over soft tissue beside them.
SHOWN = 0.35


def scene(youngs_modulus: float, radius: float) -> palpate.Scene:
    found = palpate.Scene.read(EXAMPLE)
    region = found.region[0].model_copy(update={"youngs_modulus": youngs_modulus, "radius": radius})
    tool = found.tools[0].model_copy(update={"contact": "local", "friction": 0.0})
    device = found.device.model_copy(update=UNLIMITED)
    view = found.view.model_copy(update={"strain_limit": 0.0})
    made = found.model_copy(update={"region": [region], "tools": [tool], "device": device, "view": view})
    made._source = found._source
    return made


def felt(built: BuiltScene, line: np.ndarray) -> np.ndarray:
    """Forces (n,), N, on a fingertip that slides at constant depth along the line over the nodule."""
    radius = built.scene.tools[0].radius
    path = np.column_stack([line, np.full(len(line), MIDDLE), np.full(len(line), TOP + radius - DEPTH)])
    lead = straight(path[0] + (0, 0, 3e-3), path[0], 1e-4)
    return palpate.Simulation(built).run(np.vstack([lead, path]))[len(lead) :, 2]


def direct(radius: float, nodule: Nodule) -> float:
    soft = palpate.Material(5e3, 0.45)
    block = Block((0.08, 0.08, 0.04), soft, nodule)
    return block.pressed(tools.sphere(radius), [DEPTH], 1.3 * np.sqrt(radius * DEPTH), CELL)[0].force


@pytest.mark.slow
def test_a_nodule_is_felt_where_it_is_by_no_more_than_the_direct_solution_says():
    line = np.linspace(0.02, 0.06, 81)
    plain = scene(5e3, NODULES[0][1]).build(progress=False)
    tool = plain.scene.tools[0].radius
    without = felt(plain, line)
    # The mesh of a direct solution follows the nodule; its error cancels only against the same mesh without one.
    base = {radius: direct(tool, Nodule(0.01, radius, 5e3)) for radius in (5e-3, 7e-3)}
    for youngs_modulus, radius in NODULES:
        gain = felt(scene(youngs_modulus, radius).build(progress=False), line) / without - 1
        expected = direct(tool, Nodule(0.01, radius, youngs_modulus)) / base[radius] - 1
        print(f"E {youngs_modulus:g} Pa, radius {radius:g} m: {gain.max():.3f}, direct {expected:.3f}")
        assert SHOWN * expected < gain[len(line) // 2] < expected + 0.02
        # It is felt where it is, and is gone twenty millimetres away.
        assert abs(line[gain.argmax()] - MIDDLE) < 2e-3
        assert np.abs(gain[[0, -1]]).max() < 0.02
