"""Energy over closed paths of a tool, and sums of forces. A contact must not give out more energy than was put in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.body import Body, Loads, Material
from palpate.fields import Interior
from palpate.scene import BodyMotion
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import Check, Outcome, green_of, modes_of, quiet_body
from palpate.validation.verify.contact import measures
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.paths import ClosedPaths
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes
from palpate.validation.verify.grids import box

RADIUS, TOLERANCE = 0.01, 1e-3
# Farthest that a path leads from its middle along x and y, m.
SLIDE = 0.012
FRICTIONS = (0.0, 0.3, 1.0)
# Closed paths in all, divided among friction, one and two tools, rest and motion, and limits of the device.
PATHS, TICKS = 10_000, 400
PASSIVE = "passivity"


@dataclass(frozen=True)
class Condition:
    """What is tried: friction, tools, a body in motion, a device with the usual limits."""

    friction: float
    tools: int
    moving: bool
    limited: bool

    def __str__(self) -> str:
        tools = "one tool" if self.tools == 1 else "two tools"
        body = "in motion" if self.moving else "at rest"
        return f"friction {self.friction:g}, {tools}, {body}{', usual device' if self.limited else ''}"


CONDITIONS = [
    Condition(friction, tools, moving, limited)
    for friction in FRICTIONS
    for tools in (1, 2)
    for moving in (False, True)
    for limited in (False, True)
]


def closed_paths() -> Outcome:
    """Random closed paths: press, slide, turn, lift."""
    body = body_on_table(Block(), (6, 6, 3), quadratic=True)
    bench = EnergyBench(body)
    checks = []
    for condition in CONDITIONS:
        given, peak = bench.measured(condition, PATHS // len(CONDITIONS) + 1)
        title = f"{condition}: most given out over the peak"
        checks.append(Check(title, max(measures.leak(given, peak), 0.0), 0.0, PASSIVE, TOLERANCE))
    return Outcome(checks)


@dataclass(frozen=True)
class HeldTool:
    """A tool's table without its friction, and how it is held: its origin ``height`` over its lowest point, m.

    ``orientation`` is the one about which paths turn it, w x y z.
    """

    table: Mapping[str, Any]
    height: float
    orientation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


SPHERE = HeldTool(sphere(RADIUS), RADIUS)


class EnergyBench:
    """Loops over one block."""

    def __init__(self, body: Body, tool: HeldTool = SPHERE, count: int = 60):
        self.body, self.tool = body, tool
        self.green = green_of(body, touch=top_nodes(body))
        basis = modes_of(body, count)
        # Newmark with delta = 0.6, the default of scenes; the first mode damped by a twentieth.
        damping = 4 * np.pi * basis.frequencies[0] * 0.05
        self.motion = BodyMotion(basis, (1e-3, 0.3025, 0.6, float(damping), 0.0), False, 5000.0)

    def simulation(self, condition: Condition) -> Simulation:
        """Force loop for a condition."""
        tools = [{**self.tool.table, "friction": condition.friction}] * condition.tools
        device: dict | None = {} if condition.limited else None  # the limits of scenes that give none
        return loop_of(self.body, self.green, tools, device, self.motion if condition.moving else None)

    def paths(self, condition: Condition, count: int) -> ClosedPaths:
        """Make closed paths of all tools; two of them come as close as two radii."""
        low, high = self.body.mesh.bounds
        middle = (low + high) / 2
        apart = 0.0 if condition.tools == 1 else SLIDE + RADIUS
        centres = np.array([[middle[0] + side * apart, middle[1], high[2]] for side in (-1, 1)[: condition.tools]])
        paths = ClosedPaths.over(
            centres,
            self.tool.height,
            paths=count,
            ticks=TICKS,
            slide=SLIDE,
            depth=(5e-4, 3e-3),
            seed=CONDITIONS.index(condition),
        )
        return paths.holding(self.tool.orientation)

    def played(self, condition: Condition, paths: ClosedPaths) -> tuple[np.ndarray, np.ndarray]:
        """Return forces and torques (paths, ticks, tools, 3).

        A body in motion starts each path at rest, and a device with limits each at the start of its ramp, which lasts
        for more than half of a path.
        """
        simulation = self.simulation(condition)
        if not (condition.moving or condition.limited):
            recording = simulation.play(*paths.script())
            return tuple(paths.of_script(rows) for rows in (recording.forces, recording.torques))
        played = [simulation.play(*path) for path in zip(paths.positions, paths.orientations, strict=True)]
        return np.stack([each.forces for each in played]), np.stack([each.torques for each in played])

    def measured(self, condition: Condition, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Work given out and most put in, (paths,) J each."""
        paths = self.paths(condition, count)
        forces, torques = self.played(condition, paths)
        return measures.given_out(paths.positions, forces, paths.orientations, torques)


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
