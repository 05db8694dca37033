"""Bodies: a mesh with materials, supports and loads, and the parts of it that users name."""

from palpate.body.body import Body
from palpate.body.default_support import free_end
from palpate.body.loads import Loads, gravity_error
from palpate.body.material import Material
from palpate.body.problem import description, problem_arrays, surface_moduli, surface_strain_terms
from palpate.body.selection import parse
from palpate.body.supports import Fixed
from palpate.body.surface_region import SurfaceRegion, surface_region

__all__ = [
    "Body",
    "Fixed",
    "Loads",
    "Material",
    "SurfaceRegion",
    "description",
    "free_end",
    "gravity_error",
    "parse",
    "problem_arrays",
    "surface_moduli",
    "surface_region",
    "surface_strain_terms",
]
