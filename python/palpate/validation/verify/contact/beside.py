"""Contact beside an edge of the body and beside another tool, where the half-space of the local law is not valid."""

from __future__ import annotations

import numpy as np

from palpate.simulation import Simulation
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.contact import tools
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.pressing import BLOCK, DIRECT, RADIUS
from palpate.validation.verify.contact.reference import body_on_table, cell_under, top_nodes
from palpate.validation.verify.solution import green_of

DEPTH = 1e-3
# Distances of the tool's middle from the edge, m, and the largest errors there; none where it is only shown.
EDGES = {0.02: 0.03, 0.01: 0.03, 0.005: None}
# Distance of two tools' middles, m.
APART = 0.02


def edges_and_neighbours() -> Outcome:
    """Press a sphere near an edge, and two side by side."""
    body = body_on_table(BLOCK, (10, 10, 5), quadratic=True)
    green = green_of(body, touch=top_nodes(body))
    one = loop_of(body, green, [sphere(RADIUS)])
    middle, top = BLOCK.size[1] / 2, BLOCK.size[2] + RADIUS
    reach, cell = cell_under(RADIUS, DEPTH)
    checks = []
    for distance, tolerance in EDGES.items():
        force = pressed(one, np.array([[distance, middle, top]]))[0]
        direct = BLOCK.pressed(tools.sphere(RADIUS), [DEPTH], reach, cell, place=(distance, middle))[0].force
        title = f"force, {1e3 * distance:g} mm from an edge"
        checks.append(Check(title, 1e3 * force, 1e3 * direct, DIRECT, tolerance, "mN"))
    two = loop_of(body, green, [sphere(RADIUS)] * 2)
    forces = pressed(two, np.array([[middle + side * APART / 2, middle, top] for side in (-1, 1)]))
    # The plane between two equal tools is one of symmetry.
    gap = tools.sphere(RADIUS, (APART / 2, 0.0))
    direct = BLOCK.pressed(gap, [DEPTH], reach, cell, beside=(APART / 2, 0.0))[0].force / 2
    title = f"force on each of two tools, {1e3 * APART:g} mm apart"
    checks.append(Check(title, 1e3 * forces.mean(), 1e3 * direct, DIRECT, 0.03, "mN"))
    return Outcome(checks)


def pressed(simulation: Simulation, touching: np.ndarray) -> np.ndarray:
    """Return normal forces (tools,), N, of tools that go down by the depth from where they touch, (tools, 3) m."""
    paths = [straight(place + (0, 0, DEPTH), place - (0, 0, DEPTH), 5e-5) for place in touching]
    return simulation.run(np.stack(paths, axis=1))[-1, :, 2]
