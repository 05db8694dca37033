"""Displacement, strain and stress of a body from the displacements of its surface."""

from palpate.fields.element_strain import ElementStrain
from palpate.fields.export import placed, together, write_result
from palpate.fields.exported import Exportable
from palpate.fields.interior import Interior
from palpate.fields.picture import DeformedSurface
from palpate.fields.principal import extreme_values, largest_magnitude
from palpate.fields.result import Result, ResultSource
from palpate.fields.strain_measure import (
    LINEAR_STRAIN_LIMIT,
    STRAIN_LIMIT,
    StrainMeasure,
    StrainReporting,
    StrainSource,
)
from palpate.fields.stress import StressRecovery, SurfaceStress
from palpate.fields.surface_strain import SurfaceStrain

__all__ = [
    "LINEAR_STRAIN_LIMIT",
    "STRAIN_LIMIT",
    "DeformedSurface",
    "ElementStrain",
    "Exportable",
    "Interior",
    "Result",
    "ResultSource",
    "StrainMeasure",
    "StrainReporting",
    "StrainSource",
    "StressRecovery",
    "SurfaceStrain",
    "SurfaceStress",
    "extreme_values",
    "largest_magnitude",
    "placed",
    "together",
    "write_result",
]
