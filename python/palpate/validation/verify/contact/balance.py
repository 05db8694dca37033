"""Forces on a body at rest add up to nothing at every tick: tools, supports and loads."""

from __future__ import annotations

import numpy as np

from palpate.body import Body, Loads, Material
from palpate.fields import Interior
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.contact.closed_paths import ClosedPaths
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.grids import box
from palpate.validation.verify.solution import green_of, quiet_body

RADIUS = 0.01


def balance() -> Outcome:
    """Drag two tools over a block that hangs from its bottom, under its weight."""
    forces, reactions, loads = dragged()
    checks = [Check("largest sum over the largest force", imbalance(forces, reactions, loads), 0.0, "statics", 1e-9)]
    return Outcome(checks)


def imbalance(forces: np.ndarray, reactions: np.ndarray, loads: np.ndarray) -> float:
    """Largest sum of all forces on the body over the largest force of a tool.

    Parameters
    ----------
    forces
        (ticks, tools, 3) N, on the devices.
    reactions
        (ticks, 3) N, of all supports together.
    loads
        (3,) N, of all loads together.

    """
    total = reactions + loads - forces.sum(axis=1)
    return float(np.abs(total).max() / np.abs(forces).max())


def dragged(ticks: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return forces on the devices, reactions of the supports from `K u` of every tick's shape, and loads."""
    mesh = box((5, 5, 3), (0.08, 0.08, 0.048), quadratic=True)
    loads = Loads(gravity=(0.0, 0.0, 9.81))
    body = quiet_body(mesh, Material(10e3, 0.4, 1000.0), mesh.nodes[:, 2] < 1e-9, loads)
    green = green_of(body)
    simulation = loop_of(body, green, [sphere(RADIUS, 0.3)] * 2)
    centres = np.array([[0.025, 0.04, 0.048], [0.055, 0.04, 0.048]])
    paths = ClosedPaths.over(centres, RADIUS, paths=1, ticks=ticks, slide=8e-3, depth=(1e-3, 2e-3), seed=5)
    recording = simulation.play(paths.positions[0], watch=[int(node) for node in body.mesh.surface_nodes])
    return recording.forces, _reactions(body, recording.displacements), body.load_vector().reshape(-1, 3).sum(axis=0)


def _reactions(body: Body, shapes: np.ndarray) -> np.ndarray:
    """Return sums (ticks, 3), N, of the forces of the supports, from displacements (ticks, s, 3), m, of the surface."""
    interior, stiffness = Interior(body), body.stiffness()
    supported = body.fixed_mask
    loads = body.load_vector().reshape(-1, 3)
    sums = []
    for shape in shapes:
        forces = (stiffness @ interior.extend(shape).ravel()).reshape(-1, 3) - loads
        sums.append(np.where(supported, forces, 0.0).sum(axis=0))
    return np.array(sums)
