"""Displacement, strain and stress of a body from the displacements of its surface."""

from palpate.fields.element_strain import ElementStrain
from palpate.fields.export import as_pyvista, placed, together, write_result
from palpate.fields.interior import Interior
from palpate.fields.picture import DeformedSurface, as_html, draw
from palpate.fields.principal import extreme_values, largest_magnitude
from palpate.fields.result import Result, ResultSource
from palpate.fields.strain_measure import HONEST_STRAIN, Strained, StrainMeasure, StrainSource
from palpate.fields.stress import StressRecovery, SurfaceStress
from palpate.fields.surface_strain import SurfaceStrain

__all__ = [
    "HONEST_STRAIN",
    "DeformedSurface",
    "ElementStrain",
    "Interior",
    "Result",
    "ResultSource",
    "StrainMeasure",
    "StrainSource",
    "Strained",
    "StressRecovery",
    "SurfaceStrain",
    "SurfaceStress",
    "as_html",
    "as_pyvista",
    "draw",
    "extreme_values",
    "largest_magnitude",
    "placed",
    "together",
    "write_result",
]
