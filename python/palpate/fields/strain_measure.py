"""Largest strain of a pose: the measure that is reported and that limits tools.

Of a body whose elements are known it is the largest principal strain in magnitude, `max |e_1|, |e_3|`, over the surface
nodes, with the infinitesimal strain that :class:`palpate.StressRecovery` recovers there. A bare store knows no
elements, and those of a body of more than 50,000 nodes cost too much: there it is the Green strain in the plane of the
surface, :class:`palpate.fields.SurfaceStrain`.

A measure works in two steps, so that many poses of one contact cost little each: a ``sample`` that is an affine
function of the displacements, and the ``magnitudes`` of a sample.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

# Linear elasticity is accurate up to about this strain; a pose beyond it is reported.
LINEAR_STRAIN_LIMIT = 0.1
# Strain at which the tool of a scene is held, and from which an answer has no meaning.
STRAIN_LIMIT = 0.3


class StrainMeasure(Protocol):
    """Measure of the strain of a pose."""

    def sample(self, displacements: np.ndarray) -> np.ndarray:
        """Quantity that strain follows from, affine in displacements (s, 3), m."""

    def magnitudes(self, sample: np.ndarray) -> np.ndarray:
        """Largest principal strain in magnitude at each place that is looked at."""

    def largest(self, displacements: np.ndarray) -> float:
        """Largest of the magnitudes, for displacements (s, 3), m."""


class StrainSource(Protocol):
    """Body or simulation that a pose belongs to."""

    @property
    def strain_measure(self) -> StrainMeasure:
        """Measure of the strain of its poses."""


class StrainReporting:
    """A pose that knows its largest strain; ``_source`` has the measure."""

    displacements: np.ndarray
    _source: StrainSource

    @cached_property
    def largest_strain(self) -> float:
        """Largest principal strain in magnitude over the surface; milliseconds, when read."""
        return self._source.strain_measure.largest(self.displacements)

    @property
    def within_linear_range(self) -> bool:
        """Whether the largest strain is within the 10 % up to which linear elasticity is accurate."""
        return self.largest_strain <= LINEAR_STRAIN_LIMIT
