"""Scenes: what to touch and with what, as read from a file."""

from palpate.scene.build import BuiltBody, BuiltScene
from palpate.scene.dynamics import BodyMotion, DynamicsTable, StrikeTable
from palpate.scene.model_scenes import MODES, TOOLS, YOUNGS_MODULUS, model_scene
from palpate.scene.scene import Scene
from palpate.scene.tables import MOST_FRICTION

__all__ = [
    "MODES",
    "MOST_FRICTION",
    "TOOLS",
    "YOUNGS_MODULUS",
    "BodyMotion",
    "BuiltBody",
    "BuiltScene",
    "DynamicsTable",
    "Scene",
    "StrikeTable",
    "model_scene",
]
