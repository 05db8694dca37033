"""Finite elements you can feel: soft bodies for haptics.

SI units everywhere: m, N, Pa, kg, s. Nodes are 0-based; arrays are C-ordered.
"""

from importlib.metadata import version

from palpate import models
from palpate.body import Body, Material
from palpate.errors import (
    BodyError,
    Error,
    MeshError,
    MeshWarning,
    SceneError,
    StoreError,
    StoreWarning,
    UnitError,
    ViewerError,
)
from palpate.green import Answer, GreensFunction, Touch, precompute
from palpate.mesh import TetMesh, tetrahedralize
from palpate.plan import Plan, plan
from palpate.scene import Scene
from palpate.simulation import Contact, Frame, Simulation

__version__ = version("palpate")

__all__ = [
    "Answer",
    "Body",
    "BodyError",
    "Contact",
    "Error",
    "Frame",
    "GreensFunction",
    "Material",
    "MeshError",
    "MeshWarning",
    "Plan",
    "Scene",
    "SceneError",
    "Simulation",
    "StoreError",
    "StoreWarning",
    "TetMesh",
    "Touch",
    "UnitError",
    "ViewerError",
    "models",
    "plan",
    "precompute",
    "tetrahedralize",
]
