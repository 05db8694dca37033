"""Tools that are no spheres, pressed into elements larger than their contact, beside closed forms, direct solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.body import Body
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.contact import closed_forms, tools
from palpate.validation.verify.contact.loop import pressed as pressed_tool
from palpate.validation.verify.contact.reference import Block, body_on_table, finer_in_the_middle
from palpate.validation.verify.contact.signorini import Gap

BLOCK, DEEP = Block(), Block((0.4, 0.4, 0.2))
DEPTHS = (5e-4, 1e-3, 2e-3)
# On the deep block, which is no half-space: it is stiffer than one by about the contact radius over its height.
DEEP_DEPTH = 5e-4
TOLERANCE = 0.04
DIRECT = "direct solution, Signorini by LCP"
# What is near the middle of the top may be touched, m.
REACH = 0.03


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


def pressed(body: Body, shape: Shape, depths: np.ndarray) -> np.ndarray:
    """Return forces (n,), N, along z on a device that presses the tool into the middle of the top, ever deeper."""
    return pressed_tool(body, shape.table, shape.height, depths, REACH)


def direct(block: Block, shape: Shape, depth: float) -> float:
    """Force by the direct solution, N, its elements a third of the contact's half-width."""
    _, (short, long) = shape.half_space(depth, block.plane_modulus)
    return block.pressed(shape.gap, [depth], 1.2 * long, short / 3)[0].force


def shapes() -> Outcome:
    """Ellipsoid and rounded punch on a block of large elements, and on one so deep that it is nearly a half-space."""
    coarse = body_on_table(BLOCK, (10, 10, 5), quadratic=True)
    deep = finer_in_the_middle(DEEP, 0.01, REACH, quadratic=True)
    checks = []
    for shape in (finger_pad(), flat_punch()):
        curve = np.unique([*np.linspace(1e-4, max(DEPTHS), 20), *DEPTHS])
        forces = pressed(coarse, shape, curve)[np.isin(curve, DEPTHS)]
        for depth, force in zip(DEPTHS, forces, strict=True):
            title = f"{shape.name}, 10 nodes, 5 mm, {1e3 * depth:g} mm deep"
            checks.append(Check(title, 1e3 * force, 1e3 * direct(BLOCK, shape, depth), DIRECT, TOLERANCE, "mN"))
        force = pressed(deep, shape, np.linspace(1e-4, DEEP_DEPTH, 9))[-1]
        exact, _ = shape.half_space(DEEP_DEPTH, DEEP.plane_modulus)
        title = f"{shape.name}, deep block, {1e3 * DEEP_DEPTH:g} mm"
        checks.append(Check(title, 1e3 * force, 1e3 * exact, shape.source, TOLERANCE, "mN"))
    return Outcome(checks)
