"""Energies of a body in motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.equality import ComparedByValue


@dataclass(frozen=True, eq=False)
class Energy(ComparedByValue):
    """Energies of a body in motion, J: numbers, or arrays over the ticks of a recording.

    Attributes
    ----------
    kinetic, strain
        `v M v / 2` and `u K u / 2` now.
    coupling
        Of the springs between tools and body now; zero where forces are given.
    dissipated
        Taken out by damping since the start.
    work
        Done by forces, tools and strikes since the start.

    """

    kinetic: float | np.ndarray
    strain: float | np.ndarray
    coupling: float | np.ndarray
    dissipated: float | np.ndarray
    work: float | np.ndarray

    @property
    def total(self) -> float | np.ndarray:
        """Energy of the body and its couplings now, `kinetic + strain + coupling`, J."""
        return self.kinetic + self.strain + self.coupling
