"""Displacement, strain and stress of a body from the displacements of its surface."""

from palpate.fields.export import DeformedSurface, Exportable, placed, together, write_result
from palpate.fields.result import Result, ResultSource
from palpate.fields.strain_measure import LINEAR_STRAIN_LIMIT, STRAIN_LIMIT, StrainMeasure, SurfaceStrain
from palpate.fields.stress import (
    ElementStrain,
    Interior,
    StressRecovery,
    SurfaceStress,
    extreme_values,
    largest_magnitude,
)

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
    "StressRecovery",
    "SurfaceStrain",
    "SurfaceStress",
    "extreme_values",
    "largest_magnitude",
    "placed",
    "together",
    "write_result",
]
