"""A sphere pressed into elements larger than its contact: force in the tick beside a direct solution."""

from __future__ import annotations

from functools import partial

import numpy as np

from palpate.body import Body
from palpate.validation.plots import plot_pressing
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.contact import closed_forms, measures
from palpate.validation.verify.contact.loop import pressed as pressed_tool
from palpate.validation.verify.contact.loop import sphere
from palpate.validation.verify.contact.reference import (
    Block,
    body_on_table,
    finer_in_the_middle,
    sphere_press,
)

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
# What is near the middle of the top may be touched, m.
REACH = 0.025


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
