"""A sliding sphere in numpy: the contact that a tick solves, as a script would have it.

The same equations as the local law on a flat face, with what belongs to one node: its ``C_reg``, its tangent plane, a
parabola for the sphere (Hertz), and one spring with a slider for friction. Blending between nodes, the change of
``C_reg`` along the surface, the safety stage and the hand-off are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from benches.timing import call_times
from palpate.body import Material
from palpate.green import GreensFunction
from palpate.validation.ticks import DEPTH, FRICTION, RADIUS
from palpate.validation.verify.contact.reference import SOFT

# `k` of `crates/core/src/contact/regular.rs`; most steps; a step of this part of the radius is none.
HALF_SPACE, STEPS, SETTLED = 0.766544, 16, 1e-8
# Radius of the patch that `C_reg` of a node is taken over: three mean lengths of the edges at it, m; timed solutions.
WIDTH, SOLVES = 0.017, 2000


def regular_compliance(green: GreensFunction, material: Material, point: np.ndarray, width: float) -> np.ndarray:
    """Return ``C_reg`` (3, 3), m/N, at a point of a face along z, by touches with patches of radius ``width``, m."""
    stiffness = np.stack([green.touch(point, tuple(d), width).force for d in 1e-3 * np.eye(3)], axis=1) / 1e-3
    poisson = material.poissons_ratio
    normal = HALF_SPACE * (1 - poisson**2) / (material.youngs_modulus * width)
    tangential = normal * (1 - poisson / 2) / (1 - poisson)
    return np.linalg.inv(stiffness) - np.diag([tangential, tangential, normal])


@dataclass
class NumpyContact:
    """Contact of a sphere with the plane through a point.

    Attributes
    ----------
    compliance
        ``C_reg`` (3, 3), m/N.
    point, normal
        Of the plane, m.
    radius, friction
        Of the sphere, m; Coulomb's coefficient.
    material
        Of the body.

    """

    compliance: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    radius: float
    friction: float
    material: Material
    place: np.ndarray | None = None
    spring: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def tick(self, tool: np.ndarray) -> np.ndarray:
        """Return the force on the body (3,), N, for the tool's centre at ``tool`` (3,), m, by Newton's method."""
        before = tool if self.place is None else self.place
        place, identity = before, np.eye(3)
        for _ in range(STEPS):
            force, spring, jacobian = self.local(place, before)
            residual = place + self.compliance @ force - tool
            step = np.linalg.solve(identity + self.compliance @ jacobian, -residual)
            place = place + step
            if np.linalg.norm(step) < SETTLED * self.radius:
                break
        self.place, self.spring = place, spring
        return force

    def local(self, place: np.ndarray, before: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the force on the body (3,), N, that of friction, and the derivative (3, 3), N/m, there."""
        normal = self.normal
        depth = self.radius - normal @ (place - self.point)
        if depth <= 0:
            return np.zeros(3), np.zeros(3), np.zeros((3, 3))
        poisson = self.material.poissons_ratio
        modulus, contact = self.material.youngs_modulus / (1 - poisson**2), np.sqrt(self.radius * depth)
        pressing, stiffness = 4 / 3 * modulus * contact * depth, 2 * modulus * contact
        tangential = stiffness * 2 * (1 - poisson) / (2 - poisson)
        across = np.eye(3) - np.outer(normal, normal)
        spring = across @ (self.spring + tangential * (place - before))
        jacobian = stiffness * np.outer(normal, normal) + tangential * across
        size, bound = np.linalg.norm(spring), self.friction * pressing
        if size > bound:
            direction = spring / size
            spring = bound * direction
            jacobian = stiffness * np.outer(normal - self.friction * direction, normal)
            jacobian += tangential * bound / size * (across - np.outer(direction, direction))
        return spring - pressing * normal, spring, jacobian


def contact_at(green: GreensFunction, point: np.ndarray) -> NumpyContact:
    """Return the contact at a point of a plate's top."""
    return NumpyContact(
        regular_compliance(green, SOFT, point, WIDTH), point, np.array([0.0, 0.0, 1.0]), RADIUS, FRICTION, SOFT
    )


def contact_us(green: GreensFunction, point: np.ndarray, path: np.ndarray) -> float:
    """Median time of the contact at a point along the beginning of a path (t, 3), m."""
    contact, places = contact_at(green, point), iter(path)
    return float(np.median(call_times(lambda: contact.tick(next(places)), SOLVES)))


def solve_us(green: GreensFunction, point: np.ndarray) -> float:
    """Median time to solve three equations for a force, and displace by it."""
    compliance, press = regular_compliance(green, SOFT, point, WIDTH), np.array([1e-4, 0.0, -DEPTH])
    operator = np.vstack([np.zeros((3, 3)), compliance])

    def solve() -> np.ndarray:
        block = operator[3:6]
        return block @ np.linalg.solve(block, press)

    return float(np.median(call_times(solve, SOLVES)))
