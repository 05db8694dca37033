"""Tools that are no spheres give out no energy: random closed paths of press, slide, turn and lift.

With friction and without, on a body at rest and in motion, as the law computes the force and as the safety stage hands
it on. Random paths of spheres, ten thousand of them, are `palpate verify energy`.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.validation.verify.contact import energy, measures
from palpate.validation.verify.contact.energy import Condition, EnergyBench, HeldTool
from palpate.validation.verify.contact.reference import body_on_table

# Turned so that the tool's own axis, its z, lies along x.
LYING = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)
TOOLS = {
    "ellipsoid": HeldTool({"shape": "ellipsoid", "semi_axes": (0.012, 0.009, 0.0075)}, 0.0075),
    "capsule": HeldTool({"shape": "capsule", "radius": 0.005, "length": 0.012}, 0.005, LYING),
    "punch": HeldTool({"shape": "punch", "radius": 0.006, "rounding": 0.002}, 0.0),
}
CONDITIONS = [
    Condition(0.3, 1, False, False),
    Condition(0.0, 1, True, False),
    Condition(0.3, 1, True, True),
    *(
        pytest.param(Condition(1.0, 1, moving, limited), marks=pytest.mark.slow)
        for moving, limited in ((False, True), (True, False))
    ),
]
PATHS = 8


@pytest.fixture(scope="module", params=TOOLS)
def bench(request) -> EnergyBench:
    return EnergyBench(body_on_table(energy.Block(), (6, 6, 3), quadratic=True), TOOLS[request.param])


@pytest.mark.quick(5)
@pytest.mark.parametrize("condition", CONDITIONS, ids=str)
def test_closed_paths_give_out_no_energy(bench, condition):
    given, peak = bench.measured(condition, PATHS)
    assert (peak > 1e-6).all()
    assert measures.leak(given, peak) <= energy.TOLERANCE
    if condition.friction > 0 and not condition.limited:
        # What slides rubs.
        assert (given < -1e-3 * peak).any()
