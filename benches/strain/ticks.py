"""Times of ticks of a sphere that slides on a beam, with the series of the body and without it, in turns."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import palpate
from benches.strain.bodies import cuboids
from benches.strain.cylinders import RADIUS
from benches.tick_case import Row
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_series
from palpate.simulation import Simulation
from palpate.validation.ticks import tick_times
from palpate.validation.verify.contact.loop import UNLIMITED, sphere

# Plays of each, depth, m, speed of sliding, m a tick.
PLAYS, DEPTH, STEP = 12, 0.006, 2e-5
TICKS = 1000


def sliding_ticks() -> tuple[Row, Row]:
    """Time ticks of A and of B on the cantilever, us."""
    case = next(iter(cuboids()))
    body = case.body("neo-hookean")
    table = {"name": "body", "model": "liver"}  # the table asks for a source; the body is given
    scene = Scene(body=table, tool=[sphere(RADIUS, 0.3)], device=UNLIMITED, view={"strain_limit": 0.0})
    down = np.linspace(5e-4, -DEPTH, 200)
    start = case.place + np.array([-0.01, 0.0, RADIUS])
    path = start + np.vstack([down[:, None] * case.normal, np.zeros((TICKS, 3))])
    path[len(down) :] += STEP * np.arange(TICKS)[:, None] * np.array([1.0, 0.0, 0.0]) - DEPTH * case.normal
    with tempfile.TemporaryDirectory() as folder:
        green = palpate.precompute(body, path=Path(folder) / "beam.palpate", progress=False)
        built = BuiltScene.of(scene, body, green)
        simulations = [Simulation(built), Simulation(with_series(built))]
        times: list[list[np.ndarray]] = [[], []]
        for _ in range(PLAYS):
            for simulation, of in zip(simulations, times, strict=True):
                of.append(tick_times(simulation, path[:, None, :].copy(), 1)[0, len(down) + 1 :])
    of_law = dict(zip(("A", "B"), times, strict=True))
    first, second = (Row.of("sliding", {"law": law}, np.array(of), 1, {}) for law, of in of_law.items())
    return first, second
