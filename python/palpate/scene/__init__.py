"""Scenes: bodies, tools and devices, as read from a file."""

from palpate.scene.build import BuiltBody, BuiltScene, mesh_of_body, unsolved_body
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
    "mesh_of_body",
    "model_scene",
    "unsolved_body",
]
