"""Strain at the surface nodes of a body whose elements are known."""

from __future__ import annotations

import numpy as np

from palpate.fields.principal import largest_magnitude
from palpate.fields.stress import StressRecovery


class ElementStrain:
    """Strain at the surface nodes of a body, recovered from the elements."""

    def __init__(self, recovery: StressRecovery):
        self.recovery = recovery

    def sample(self, displacements: np.ndarray) -> np.ndarray:
        """Strain (s, 3, 3) for displacements (s, 3), m."""
        return self.recovery.recover(displacements).strain

    def magnitudes(self, sample: np.ndarray) -> np.ndarray:
        """Largest principal strain in magnitude at each surface node, (s,)."""
        return largest_magnitude(sample)

    def largest(self, displacements: np.ndarray) -> float:
        """Largest principal strain in magnitude over the surface, for displacements (s, 3), m."""
        return float(self.magnitudes(self.sample(displacements)).max())
