"""Scenes: what to touch and with what, as read from a file."""

from palpate.scene.build import BuiltBody, BuiltScene, unsolved_body
from palpate.scene.dynamics import BodyMotion, DynamicsTable, StrikeTable
from palpate.scene.model_scenes import MODES, TOOLS, YOUNGS_MODULUS, model_scene
from palpate.scene.scene import Scene
from palpate.scene.tables import MOST_FRICTION, DeviceTable, ToolTable

__all__ = [
    "MODES",
    "MOST_FRICTION",
    "TOOLS",
    "YOUNGS_MODULUS",
    "BodyMotion",
    "BuiltBody",
    "BuiltScene",
    "DeviceTable",
    "DynamicsTable",
    "Scene",
    "StrikeTable",
    "ToolTable",
    "model_scene",
    "unsolved_body",
]
