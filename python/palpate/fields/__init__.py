"""Displacement, strain and stress of a body from the displacements of its surface."""

from palpate.fields.element_strain import ElementStrain
from palpate.fields.interior import Interior
from palpate.fields.principal import extreme_values, largest_magnitude
from palpate.fields.strain_measure import HONEST_STRAIN, Strained, StrainMeasure, StrainSource
from palpate.fields.stress import StressRecovery, SurfaceStress
from palpate.fields.surface_strain import SurfaceStrain

__all__ = [
    "HONEST_STRAIN",
    "ElementStrain",
    "Interior",
    "StrainMeasure",
    "StrainSource",
    "Strained",
    "StressRecovery",
    "SurfaceStrain",
    "SurfaceStress",
    "extreme_values",
    "largest_magnitude",
]
