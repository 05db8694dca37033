"""Friction: Coulomb's cone at every tick of random drags, and Mindlin's curve from sticking to slipping."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from palpate.body import Body
from palpate.validation.plots import plot_partial_slip
from palpate.validation.verify.check import Check, Outcome
from palpate.validation.verify.contact import closed_forms, measures
from palpate.validation.verify.contact.closed_paths import ClosedPaths
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.reference import SOFT, Block, finer_in_the_middle, top_middle, top_nodes
from palpate.validation.verify.contact.sliding import flat_loop
from palpate.validation.verify.solution import green_of

RADIUS = 0.01
DEEP = Block((0.4, 0.4, 0.2))
# Largest error of the curve of partial slip over full slip: tight enough to see a force that is 5 % off.
PARTIAL_SLIP, TICKS = 0.03, 46


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
