"""Rigid tools pressed into elements larger than their contact: force in the tick beside a direct solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from palpate.body import Body
from palpate.simulation import Simulation
from palpate.validation.plots import plot_pressing
from palpate.validation.verify.benchmark import Check, Outcome, green_of
from palpate.validation.verify.contact import closed_forms, measures, tools
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.loop import pressed as pressed_tool
from palpate.validation.verify.contact.reference import (
    Block,
    body_on_table,
    cell_under,
    finer_in_the_middle,
    sphere_press,
    top_nodes,
)
from palpate.validation.verify.contact.tools import Gap

BLOCK, DEEP = Block(), Block((0.4, 0.4, 0.2))
RADIUS = 0.01
DEPTHS = (5e-4, 1e-3, 2e-3)
DIRECT = "direct solution, Signorini by LCP"
# Largest errors by mesh, at each of the depths: elements, spacing of surface nodes (mm), and how they are made.
TOLERANCES = {
    ("10 nodes", 5.0): (0.03, 0.03, 0.04),
    ("10 nodes", 2.5): (0.02, 0.02, 0.02),
    ("4 nodes", 5.0): (0.07, 0.07, 0.07),
}
# What is near the middle of the top may be touched, m: by a sphere, and by other tools.
REACH, WIDE_REACH = 0.025, 0.03
# Other tools on the deep block, which is no half-space: it is stiffer than one by about the contact radius over its
# height.
DEEP_DEPTH, TOLERANCE = 5e-4, 0.04
# Beside an edge of the body and beside another tool the half-space of the local law is not valid: depth, distances of
# the tool's middle from the edge and the largest errors there, none where it is only shown, and of two tools, m.
BESIDE_DEPTH, EDGES, APART = 1e-3, {0.02: 0.03, 0.01: 0.03, 0.005: None}, 0.02


def meshes() -> dict[tuple[str, float], Body]:
    """Return the block, meshed for the force loop."""
    return {
        ("10 nodes", 5.0): body_on_table(BLOCK, (10, 10, 5), quadratic=True),
        ("10 nodes", 2.5): finer_in_the_middle(BLOCK, 5e-3, REACH, quadratic=True),
        ("4 nodes", 5.0): body_on_table(BLOCK, (20, 20, 10), quadratic=False),
    }


def pressed(body: Body, depths: np.ndarray, radius: float = RADIUS) -> np.ndarray:
    """Return forces (n,), N, along z on a device that presses a sphere into the middle of the top, ever deeper."""
    return pressed_tool(body, sphere(radius), radius, depths, REACH)


def hertz() -> Outcome:
    """Force of a rigid sphere at three depths, and its exponent on a block so deep that it is a half-space."""
    truth = np.array([sphere_press(BLOCK, RADIUS, depth).force for depth in DEPTHS])
    curve = np.linspace(1e-4, 2.2e-3, 22)
    checks, curves = [], {}
    for (element, spacing), body in meshes().items():
        depths = np.unique(np.concatenate([curve, DEPTHS]))
        forces = pressed(body, depths)
        curves[f"Palpate, {element}, {spacing:g} mm"] = (depths, forces)
        found = forces[np.isin(depths, DEPTHS)]
        tolerances = TOLERANCES[element, spacing]
        for depth, force, target, tolerance in zip(DEPTHS, found, truth, tolerances, strict=True):
            title = f"force, {element}, {spacing:g} mm, {1e3 * depth:g} mm deep"
            checks.append(Check(title, 1e3 * force, 1e3 * target, DIRECT, tolerance, "mN"))
    checks += _on_a_deep_block()
    plot = partial(plot_pressing, curves, (np.array(DEPTHS), truth), "direct solution")
    return Outcome(checks, {"contact-pressing.png": plot})


def _on_a_deep_block() -> list[Check]:
    depths = np.geomspace(1e-4, 1e-3, 9)
    body = finer_in_the_middle(DEEP, 0.01, 0.03, quadratic=True)
    forces = pressed(body, depths)
    exact = [closed_forms.sneddon_sphere(depth, RADIUS, DEEP.plane_modulus)[0] for depth in depths]
    direct = sphere_press(DEEP, RADIUS, DEPTHS[1]).force
    target = closed_forms.sneddon_sphere(DEPTHS[1], RADIUS, DEEP.plane_modulus)[0]
    return [
        Check("exponent of the force, deep block", measures.exponent(depths, forces), 1.5, "Hertz", 0.05 / 1.5),
        Check("exponent, Sneddon's sphere", measures.exponent(depths, np.array(exact)), 1.5, "Hertz", None),
        Check("the direct solution, deep block, 1 mm", 1e3 * direct, 1e3 * target, "Sneddon 1965", 0.025, "mN"),
    ]


@dataclass(frozen=True)
class Shape:
    """A tool that comes down with its origin ``height`` over its lowest point, m.

    ``gap`` is its underside, ``half_space`` its force on a half-space of a plane modulus at a depth, N, with the
    smallest and the largest half-width of the contact, m.
    """

    name: str
    table: dict[str, Any]
    height: float
    gap: Gap
    half_space: Callable[[float, float], tuple[float, tuple[float, float]]]
    source: str


def finger_pad(semi_axes: tuple[float, float, float] = (0.016, 0.012, 0.010)) -> Shape:
    """Half an ellipsoid, by Hertz."""
    a, b, c = semi_axes

    def half_space(depth: float, plane_modulus: float) -> tuple[float, tuple[float, float]]:
        force, (long, short) = closed_forms.hertz_ellipsoid(depth, (a**2 / c, b**2 / c), plane_modulus)
        return force, (short, long)

    table = {"shape": "ellipsoid", "semi_axes": semi_axes, "friction": 0.0}
    return Shape("ellipsoid", table, c, tools.ellipsoid(semi_axes), half_space, "Hertz, ellipse")


def flat_punch(radius: float = 0.006, rounding: float = 0.002) -> Shape:
    """Flat punch with a rounded rim, by Sneddon's integrals."""

    def half_space(depth: float, plane_modulus: float) -> tuple[float, tuple[float, float]]:
        force, contact = closed_forms.rounded_punch(depth, radius - rounding, rounding, plane_modulus)
        return force, (contact, contact)

    table = {"shape": "punch", "radius": radius, "rounding": rounding, "friction": 0.0}
    gap = tools.rounded_punch(radius, rounding)
    return Shape("rounded punch", table, 0.0, gap, half_space, "Ciavarella 1999")


def pressed_shape(body: Body, shape: Shape, depths: np.ndarray) -> np.ndarray:
    """Return forces (n,), N, along z on a device that presses the tool into the middle of the top, ever deeper."""
    return pressed_tool(body, shape.table, shape.height, depths, WIDE_REACH)


def direct(block: Block, shape: Shape, depth: float) -> float:
    """Force by the direct solution, N, its elements a third of the contact's half-width."""
    _, (short, long) = shape.half_space(depth, block.plane_modulus)
    return block.pressed(shape.gap, [depth], 1.2 * long, short / 3)[0].force


def shapes() -> Outcome:
    """Ellipsoid and rounded punch on a block of large elements, and on one so deep that it is nearly a half-space."""
    coarse = body_on_table(BLOCK, (10, 10, 5), quadratic=True)
    deep = finer_in_the_middle(DEEP, 0.01, WIDE_REACH, quadratic=True)
    checks = []
    for shape in (finger_pad(), flat_punch()):
        curve = np.unique([*np.linspace(1e-4, max(DEPTHS), 20), *DEPTHS])
        forces = pressed_shape(coarse, shape, curve)[np.isin(curve, DEPTHS)]
        for depth, force in zip(DEPTHS, forces, strict=True):
            title = f"{shape.name}, 10 nodes, 5 mm, {1e3 * depth:g} mm deep"
            checks.append(Check(title, 1e3 * force, 1e3 * direct(BLOCK, shape, depth), DIRECT, TOLERANCE, "mN"))
        force = pressed_shape(deep, shape, np.linspace(1e-4, DEEP_DEPTH, 9))[-1]
        exact, _ = shape.half_space(DEEP_DEPTH, DEEP.plane_modulus)
        title = f"{shape.name}, deep block, {1e3 * DEEP_DEPTH:g} mm"
        checks.append(Check(title, 1e3 * force, 1e3 * exact, shape.source, TOLERANCE, "mN"))
    return Outcome(checks)


def edges_and_neighbours() -> Outcome:
    """Press a sphere near an edge, and two side by side."""
    body = body_on_table(BLOCK, (10, 10, 5), quadratic=True)
    green = green_of(body, touch=top_nodes(body))
    one = loop_of(body, green, [sphere(RADIUS)])
    middle, top = BLOCK.size[1] / 2, BLOCK.size[2] + RADIUS
    reach, cell = cell_under(RADIUS, BESIDE_DEPTH)
    checks = []
    for distance, tolerance in EDGES.items():
        force = pressed_down(one, np.array([[distance, middle, top]]))[0]
        solved = BLOCK.pressed(tools.sphere(RADIUS), [BESIDE_DEPTH], reach, cell, place=(distance, middle))[0].force
        title = f"force, {1e3 * distance:g} mm from an edge"
        checks.append(Check(title, 1e3 * force, 1e3 * solved, DIRECT, tolerance, "mN"))
    two = loop_of(body, green, [sphere(RADIUS)] * 2)
    forces = pressed_down(two, np.array([[middle + side * APART / 2, middle, top] for side in (-1, 1)]))
    # The plane between two equal tools is one of symmetry.
    gap = tools.sphere(RADIUS, (APART / 2, 0.0))
    solved = BLOCK.pressed(gap, [BESIDE_DEPTH], reach, cell, beside=(APART / 2, 0.0))[0].force / 2
    title = f"force on each of two tools, {1e3 * APART:g} mm apart"
    checks.append(Check(title, 1e3 * forces.mean(), 1e3 * solved, DIRECT, 0.03, "mN"))
    return Outcome(checks)


def pressed_down(simulation: Simulation, touching: np.ndarray) -> np.ndarray:
    """Return normal forces (tools,), N, of tools that go down by the depth from where they touch, (tools, 3) m."""
    paths = [straight(place + (0, 0, BESIDE_DEPTH), place - (0, 0, BESIDE_DEPTH), 5e-5) for place in touching]
    return simulation.run(np.stack(paths, axis=1))[-1, :, 2]
