"""What a body in motion gives a hand over closed paths, by its time step: docs/dynamics.md has the figures.

A hand meets a new force at the end of each of the body's steps. With steps longer than a tick it meets a staircase,
which lags behind its motion: going in it feels too little, coming out too much.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.scene import BodyMotion
from palpate.validation.verify.contact import energy, measures
from palpate.validation.verify.contact.energy import RADIUS, SLIDE, EnergyBench
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.paths import ClosedPaths
from palpate.validation.verify.contact.reference import body_on_table

PATHS, TICKS = 12, 1000
# Of the peak, by the step, s: a second for a path of a few millimetres, 0.09 m/s at the fastest.
MOST = {1e-3: 1e-3, 2e-3: 0.02, 5e-3: 0.08}


@pytest.fixture(scope="module")
def bench() -> EnergyBench:
    return EnergyBench(body_on_table(energy.Block(), (6, 6, 3), quadratic=True))


def given_out(bench: EnergyBench, dt: float) -> np.ndarray:
    """Work that hands get back beyond what they put in, over its peak (paths,)."""
    low, high = bench.body.mesh.bounds
    middle = np.array([[*((low + high) / 2)[:2], high[2]]])
    paths = ClosedPaths.over(middle, RADIUS, paths=PATHS, ticks=TICKS, slide=SLIDE, depth=(5e-4, 3e-3))
    _, alpha, delta, *damping = bench.motion.scheme
    motion = BodyMotion(bench.motion.basis, (dt, alpha, delta, *damping), False, bench.motion.coupling)
    loop = loop_of(bench.body, bench.green, [sphere(RADIUS)], None, motion)
    forces = np.stack([loop.play(each).computed_forces for each in paths.positions])
    given, peak = measures.given_out(paths.positions, forces)
    assert (peak > 1e-6).all()
    return given / peak


def test_a_step_of_a_tick_gives_out_nothing_and_longer_ones_what_is_documented(bench):
    most = {dt: float(given_out(bench, dt).max()) for dt in MOST}
    assert all(most[dt] <= limit for dt, limit in MOST.items()), most
    # The staircase is seen: its share grows with the steps.
    assert most[5e-3] > 2 * most[2e-3] > 0.01
