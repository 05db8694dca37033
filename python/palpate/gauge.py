"""The largest strain of a pose: the one measure that is reported everywhere, and that holds a tool back.

Of a body whose elements are known it is the largest principal strain in magnitude, `max |e_1|, |e_3|`, over the surface
nodes, with the infinitesimal strain that :class:`palpate.stress.StressRecovery` recovers there. A bare store knows no
elements: there it is the Green strain in the plane of the surface, :class:`palpate.strain.SurfaceStrain`.

A gauge splits the way to it in two, so that many poses of one contact cost little each: a ``sample`` that is an affine
function of the displacements, and the ``magnitudes`` of a sample.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from palpate.principal import largest_magnitude
from palpate.stress import StressRecovery


class StrainGauge(Protocol):
    """What measures the strain of a pose."""

    def sample(self, displacements: np.ndarray) -> np.ndarray:
        """Give what strain follows from, affine in displacements (s, 3), m."""

    def magnitudes(self, sample: np.ndarray) -> np.ndarray:
        """Largest principal strain in magnitude at each place that is looked at."""

    def largest(self, displacements: np.ndarray) -> float:
        """Largest of them all."""


class ElementStrain:
    """Strain at the surface nodes, recovered from the elements.

    Parameters
    ----------
    recovery
        Of the body, at its surface nodes.

    """

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
