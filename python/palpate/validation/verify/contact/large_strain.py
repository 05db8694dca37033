"""A sphere pressed deep into neo-Hookean bodies: force in the tick beside full Newton solutions."""

from __future__ import annotations

import numpy as np

from palpate.body import Material
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_series
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import Check, Outcome, green_of, quiet_body
from palpate.validation.verify.contact.loop import UNLIMITED, pressed, sphere, straight
from palpate.validation.verify.contact.reference import Block, finer_in_the_middle
from palpate.validation.verify.grids import box

RADIUS, SOFT = 0.01, Material(10e3, 0.45, law="neo-hookean")
# Depths, m, and forces, N, in the middle of a cylinder of 100 mm radius and 50 mm height that is bonded below: full
# Newton's method on axisymmetric 9-node elements (`benches/strain`).
BLOCK_DEPTHS, BLOCK_FORCES = np.array([0.005, 0.01]), np.array([0.62977, 1.70484])
# The same on a beam of 100 x 20 x 20 mm, 20 mm from its free end, on its own 10-node elements.
BEAM, CELLS = (0.1, 0.02, 0.02), (20, 4, 4)
BEAM_DEPTHS, BEAM_FORCES = np.array([0.005, 0.01, 0.02]), np.array([3.959e-3, 8.159e-3, 1.604e-2])
TOLERANCES = {"block": 0.025, "beam": 0.035}


def large_strain() -> Outcome:
    """Force on a block to a fifth of its height, and on a cantilever bent by a fifth of its length."""
    block = finer_in_the_middle(Block((0.2, 0.2, 0.05), SOFT), 0.005, 0.02, quadratic=True)
    found = pressed(block, sphere(RADIUS), RADIUS, BLOCK_DEPTHS, 0.02)
    rows = [("block", *row) for row in zip(BLOCK_DEPTHS, found, BLOCK_FORCES, strict=True)]
    rows += [("beam", *row) for row in zip(BEAM_DEPTHS, _on_a_beam(), BEAM_FORCES, strict=True)]
    source = {"block": "full Newton, axisymmetric elements", "beam": "full Newton, the same elements"}
    return Outcome(
        [
            Check(
                f"force, {name}, {1e3 * depth:g} mm deep",
                1e3 * force,
                1e3 * target,
                source[name],
                TOLERANCES[name],
                "mN",
            )
            for name, depth, force, target in rows
        ]
    )


def _on_a_beam() -> np.ndarray:
    """Return forces with the series of the body, N."""
    mesh = box(CELLS, BEAM, quadratic=True)
    body = quiet_body(mesh, SOFT, mesh.nodes[:, 0] < 1e-9)
    place = np.array([0.08, 0.01, BEAM[2]])
    surface = mesh.surface_nodes
    near = surface[np.linalg.norm(mesh.nodes[surface] - place, axis=1) < 3.6 * RADIUS]
    table = {"name": "body", "model": "liver"}  # the table asks for a source; the body is given
    scene = Scene(body=table, tool=[sphere(RADIUS)], device=UNLIMITED, view={"strain_limit": 0.0})
    simulation = Simulation(with_series(BuiltScene.of(scene, body, green_of(body, touch=near))))
    top = place + (0.0, 0.0, RADIUS + 5e-4)
    path = straight(top, top - (0.0, 0.0, BEAM_DEPTHS[-1] + 6e-4), 1e-5)
    forces = simulation.run(path)[:, 2]
    return np.interp(BEAM_DEPTHS, place[2] + RADIUS - path[:, 2], forces)
