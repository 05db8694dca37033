"""The `[dynamics]` table: a body that moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from palpate import _native
from palpate.body import Body
from palpate.dynamics import ModalBasis, modes, rayleigh_from_ratios
from palpate.errors import SceneError
from palpate.scene.table import Direction, Point, Stiffness, Table, Time, is_whole, one_of

# All modes of so many free dofs are quick to compute and to step; larger bodies take the lowest ones.
ALL_MODES_DOFS = 3000
LOWEST_MODES = 200
# The second damping ratio is that of this mode, or of the last one.
SECOND_DAMPED_MODE = 10

Ratio = Annotated[float, Field(ge=0, lt=1)]
Factor = Annotated[float, Field(ge=0, allow_inf_nan=False)]


_COUNT = one_of("how many, such as 200, or 'all'", lambda v: v is None or v == "all" or is_whole(v, 1))


class StrikeTable(Table):
    """A strike on the surface point closest to a point."""

    point: Point
    """Point near the struck place of the surface."""
    impulse: Direction
    """Impulse, N s."""
    duration: Time = 0.0
    """Length of the half sine of the force; 0 is a single time step."""


class DynamicsTable(Table):
    """Motion by modes: Newmark's scheme, or the exact step of each mode under forces held within it.

    ``delta`` damps exact modes in contact only: it is the weight of a step's new force.
    """

    scheme: Literal["newmark", "exact"] = "newmark"
    """`newmark` is Newmark's scheme; `exact` takes the exact step of each mode under a force held within the step."""
    dt: Annotated[Time, Field(ge=1e-4, le=1e-2)] = 1e-3
    """Time step, 0.1 to 10 ms."""
    delta: Annotated[float, Field(ge=0.5, allow_inf_nan=False)] = 0.6
    """Newmark's delta, at least 0.5; above 0.5 it damps what is too fast for the time step."""
    alpha: Factor | None = None
    """Newmark's alpha. Default: `(delta + 1/2)^2 / 4`. Not for `exact`."""
    modes: Annotated[int | Literal["all"] | None, _COUNT] = None
    """Number of modes, or `"all"`. Default: all up to 3000 free degrees of freedom, else 200."""
    mass: Literal["consistent", "lumped"] = "consistent"
    """Mass matrix."""
    damping_ratios: tuple[Ratio, Ratio] = (0.05, 0.05)
    """Damping ratios of the first and the tenth mode."""
    rayleigh: tuple[Factor, Factor] | None = None
    """Rayleigh factors of mass (1/s) and stiffness (s), in place of `damping_ratios`."""
    coupling: Stiffness | None = None
    """Spring between the tool and the body. Default: the device's `max_stiffness`, which is also the largest value."""
    strike: StrikeTable | None = None
    """Strike that the page gives when it opens."""

    @model_validator(mode="after")
    def _one_damping(self) -> DynamicsTable:
        if self.rayleigh is not None and "damping_ratios" in self.model_fields_set:
            raise ValueError("give damping_ratios or rayleigh, not both")
        if self.scheme == "exact" and self.alpha is not None:
            raise ValueError("alpha belongs to scheme = 'newmark'; leave it out")
        return self

    def build(self, body: Body, max_stiffness: float, progress: bool | Callable[[int, int], None] = True) -> BodyMotion:
        """Modes and coefficients for a body.

        Raises Error for a coupling stiffer than the device renders, an unstable scheme, more modes than there are.
        """
        coupling = max_stiffness if self.coupling is None else self.coupling
        if coupling > max_stiffness:
            raise SceneError(
                f"dynamics.coupling = {coupling:g} N/m is stiffer than device.max_stiffness = {max_stiffness:g} N/m"
            )
        free = body.fixed_mask.size - len(body.fixed_dofs)
        count = self.modes or ("all" if free <= ALL_MODES_DOFS else LOWEST_MODES)
        basis = modes(body, None if count == "all" else min(count, free), mass=self.mass, progress=progress)
        alpha = (self.delta + 0.5) ** 2 / 4 if self.alpha is None else self.alpha
        scheme = (self.dt, alpha, self.delta, *self._rayleigh(basis))
        if self.scheme == "newmark":
            _native.require_stable(scheme, float(basis.eigenvalues[-1]))
        return BodyMotion(basis, scheme, self.scheme == "exact", coupling)

    def _rayleigh(self, basis: ModalBasis) -> tuple[float, float]:
        if self.rayleigh is not None:
            return self.rayleigh
        distinct = np.unique(basis.frequencies)
        first, second = distinct[0], distinct[min(SECOND_DAMPED_MODE, len(distinct)) - 1]
        if first == second:
            return 4 * np.pi * first * self.damping_ratios[0], 0.0
        return rayleigh_from_ratios(self.damping_ratios[0], first, self.damping_ratios[1], second)


@dataclass(frozen=True)
class BodyMotion:
    """Modes and time integration of a body of a scene."""

    basis: ModalBasis
    # Time step (s), alpha, delta, and the Rayleigh factors of mass (1/s) and stiffness (s).
    scheme: tuple[float, float, float, float, float]
    exact: bool  # whether each mode takes its exact step instead of Newmark's
    coupling: float  # spring between a patch and its tool, N/m
