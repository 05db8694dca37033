"""A tool slid over a body: variation and jumps of a force that should be even, Coulomb's cone, and Mindlin's curve."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from palpate import models
from palpate.body import Body, Material
from palpate.simulation import Simulation
from palpate.validation.plots import plot_partial_slip
from palpate.validation.verify.benchmark import Check, Outcome, green_of, quiet_body
from palpate.validation.verify.contact import closed_forms, measures
from palpate.validation.verify.contact.loop import loop_of, sphere, straight, swept, touch_heights
from palpate.validation.verify.contact.paths import (
    ClosedPaths,
    Curve,
    away_from_supports,
    section,
    touches_nothing_else,
)
from palpate.validation.verify.contact.reference import (
    SOFT,
    Block,
    body_on_table,
    finer_in_the_middle,
    top_middle,
    top_nodes,
)

RADIUS, DEPTH = 0.01, 1e-3
# Sections of the built-in bodies that are slid along: axis across the plane, through the middle of the body.
SECTIONS = {"liver": 1, "kidney": 0, "doll": 0}
# On them: radius and depth of the tool, distance of the places, distance from supports, and sharpest bend, m and 1/m.
CURVED_RADIUS, CURVED_DEPTH, STEP, CLEAR, SHARPEST = 8e-3, 2e-3, 5e-4, 0.025, 60.0
EVEN, SMOOTH = "an even surface", "a smooth surface"
# So deep that it is a half-space.
DEEP = Block((0.4, 0.4, 0.2))
# Largest error of the curve of partial slip over full slip: tight enough to see a force that is 5 % off.
PARTIAL_SLIP, TICKS = 0.03, 46


@dataclass(frozen=True)
class Slide:
    """Forces (n, 3), N, on the device along places (n, 3), m, of a surface with normals (n, 3)."""

    points: np.ndarray
    normals: np.ndarray
    forces: np.ndarray
    step: float


def ripple() -> Outcome:
    """Slide 40 mm over a flat block, and along sections of the built-in bodies."""
    checks = []
    # Wide enough that the sides are not felt where the tool slides.
    wide = Block((0.2, 0.2, 0.05))
    flat = {
        "10 nodes": finer_in_the_middle(wide, 0.01, 0.04, quadratic=True),
        "4 nodes": body_on_table(wide, (40, 40, 10), quadratic=False),
    }
    for name, body in flat.items():
        simulation = loop_of(body, green_of(body, touch=top_nodes(body, 0.04)), [sphere(RADIUS)])
        found = measures.ripple(flat_slide(simulation, body).forces)
        checks.append(Check(f"flat block, {name}, 5 mm: half the range", found, 0.0, EVEN, 0.003))
    for name in SECTIONS:
        slide = curved_slide(*curved_loop(name))
        rms, largest = measures.roughness(slide.step, slide.forces)
        drawn = measures.attraction(slide.forces, slide.normals)
        length = f"{1e3 * slide.step * len(slide.forces):.0f} mm"
        checks += [
            Check(f"{name}, {length}: rms about a cubic over 20 mm", rms, 0.0, EVEN, 0.005),
            Check(f"{name}, {length}: largest", largest, 0.0, EVEN, 0.02),
            Check(f"{name}: attraction over the largest force", drawn, 0.0, EVEN, 0.0),
        ]
    return Outcome(checks)


def jumps() -> Outcome:
    """Sweep in steps of a micrometre across nodes, edges and changes of patch; and press, micrometre by micrometre."""
    simulation, body = flat_loop((10, 10, 5), quadratic=True)
    middle = top_middle(body)
    found = {
        "flat, along an edge": micro_sweep(simulation, middle - (6e-3, 0, 0), middle + (6e-3, 0, 0), RADIUS - DEPTH),
        "flat, across": micro_sweep(simulation, middle - (4e-3, 6e-3, 0), middle + (4e-3, 6e-3, 0), RADIUS - DEPTH),
        "flat, pressing": micro_sweep(simulation, middle, middle - (0, 0, 2e-3), RADIUS + 2e-5),
    }
    for name in SECTIONS:
        simulation, curve = curved_loop(name)
        found[name] = micro_slide(simulation, curve)
    return Outcome(
        [Check(f"{name}: largest jump over the allowed", jump, 0.0, SMOOTH, 1.0) for name, jump in found.items()]
    )


def flat_loop(cells: tuple[int, int, int], *, quadratic: bool, friction: float = 0.0) -> tuple[Simulation, Body]:
    """Force loop of the block with a sphere."""
    body = body_on_table(Block(), cells, quadratic=quadratic)
    return loop_of(body, green_of(body, touch=top_nodes(body)), [sphere(RADIUS, friction)]), body


def flat_slide(simulation: Simulation, body: Body, length: float = 0.04) -> Slide:
    """Slide over the middle of the top, at an angle to the edges of the elements."""
    middle = top_middle(body)
    along = length / 2 * np.array([np.cos(0.3), np.sin(0.3), 0.0])
    points = straight(middle - along, middle + along, 1e-4)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    forces = swept(simulation, points, normals, np.full(len(points), RADIUS - DEPTH))
    return Slide(points, normals, forces, 1e-4)


def curved_loop(name: str) -> tuple[Simulation, Curve]:
    """Force loop of a built-in body with a sphere, and the path along it: outside of creases, away from supports."""
    mesh = models.load(name)
    fixed = models.fixed(name, mesh)
    body = quiet_body(mesh, Material(10e3, 0.45), fixed)
    normal = np.eye(3)[SECTIONS[name]]
    curve = section(mesh, mesh.bounds.mean(axis=0), normal, STEP)
    bend = np.linalg.norm(np.gradient(curve.normals, axis=0), axis=1) / STEP
    gentle = np.convolve(bend, np.ones(9) / 9, mode="same") < SHARPEST
    far = away_from_supports(curve, mesh, fixed, CLEAR)
    curve = curve.part(gentle & far & touches_nothing_else(curve, mesh, CURVED_RADIUS))
    return loop_of(body, green_of(body, precision="f32"), [sphere(CURVED_RADIUS)]), curve


def curved_slide(simulation: Simulation, curve: Curve) -> Slide:
    """Slide along a curve with the tool's centre at a constant depth below the height at which it touches."""
    heights = touch_heights(simulation, curve.points, curve.normals, CURVED_RADIUS)
    forces = swept(simulation, curve.points, curve.normals, heights - CURVED_DEPTH)
    return Slide(curve.points, curve.normals, forces, curve.step)


def micro_sweep(simulation: Simulation, start: np.ndarray, end: np.ndarray, height: float) -> float:
    """Largest jump in a straight sweep whose centre stands at a height over points of the surface."""
    points = straight(start, end, 1e-6)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return measures.largest_jump(swept(simulation, points, normals, np.full(len(points), height)))


def micro_slide(simulation: Simulation, curve: Curve, length: float = 0.03) -> float:
    """Largest jump in a slide along the middle of a curve, between places that lie a micrometre apart."""
    count = round(length / curve.step)
    first = (len(curve.points) - count) // 2
    part = slice(first, first + count)
    fine = np.linspace(0, count - 1, round((count - 1) * curve.step / 1e-6))
    columns = np.hstack([curve.points[part], curve.normals[part]]).T
    rows = np.column_stack([np.interp(fine, np.arange(count), column) for column in columns])
    return measures.largest_jump(
        swept(simulation, rows[:, :3], rows[:, 3:], np.full(len(rows), CURVED_RADIUS - CURVED_DEPTH))
    )


def friction() -> Outcome:
    """Cone and partial slip."""
    checks = []
    for mu in (0.3, 1.0):
        beyond = measures.beyond_cone(*dragged(mu), mu)
        checks.append(Check(f"beyond the cone, friction {mu:g}", max(beyond, 0.0), 0.0, "Coulomb", 1e-6))
    slip = partial_slip(0.3)
    checks.append(Check("partial slip: largest error over mu F_n", slip.error, 0.0, "Mindlin 1949", PARTIAL_SLIP))
    return Outcome(
        checks, {"contact-partial-slip.png": partial(plot_partial_slip, slip.shifts, slip.forces, slip.exact)}
    )


def dragged(mu: float, drags: int = 60, ticks: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """Return forces on the device and normals (n, 3) of random drags over the flat block."""
    simulation, body = flat_loop((10, 10, 5), quadratic=True, friction=mu)
    centre = top_middle(body)[None]
    paths = ClosedPaths.over(centre, RADIUS, paths=drags, ticks=ticks, slide=0.015, depth=(5e-4, 2e-3), seed=3)
    forces = simulation.play(paths.script()[0]).forces.reshape(-1, 3)
    return forces, np.tile([0.0, 0.0, 1.0], (len(forces), 1))


@dataclass(frozen=True)
class PartialSlip:
    """Sideways forces (n,), N, at sideways displacements (n,), m, of a tool pressed in, and those of theory."""

    shifts: np.ndarray
    forces: np.ndarray
    exact: np.ndarray
    limit: float

    @property
    def error(self) -> float:
        """Largest difference over the force of full slip."""
        return float(np.abs(self.forces - self.exact).max() / self.limit)


def deep_block() -> Body:
    """Return a block so deep that it is a half-space."""
    return finer_in_the_middle(DEEP, 0.01, 0.03, quadratic=True)


def partial_slip(mu: float, body: Body | None = None, depth: float = 1e-3) -> PartialSlip:
    """Press into a deep block, then shift by one and a half times what makes it slip."""
    body = body or deep_block()
    simulation = loop_of(body, green_of(body, touch=top_nodes(body, 0.03)), [sphere(RADIUS, mu)])
    top = top_middle(body) + (0, 0, RADIUS)
    normal, contact_radius = closed_forms.sneddon_sphere(depth, RADIUS, DEEP.plane_modulus)
    stiffness = closed_forms.mindlin_stiffness(contact_radius, SOFT.youngs_modulus, SOFT.poissons_ratio)
    shifts = np.linspace(0, 1.5 * 1.5 * mu * normal / stiffness, TICKS)
    press = straight(top + (0, 0, 1e-3), top - (0, 0, depth), 2e-5)
    forces = simulation.run(np.vstack([press, press[-1] + np.outer(shifts, (1, 0, 0))]))[len(press) :]
    exact = closed_forms.mindlin_force(shifts, normal, mu, stiffness)
    return PartialSlip(shifts, -forces[:, 0], exact, mu * normal)
