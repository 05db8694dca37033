"""Fit of a scene's material to indentations that were measured."""

from palpate.fitting.fit import fit
from palpate.fitting.measurements import Indentations
from palpate.fitting.result import Fit, FittedParameter

__all__ = ["Fit", "FittedParameter", "Indentations", "fit"]
