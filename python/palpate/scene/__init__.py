"""Scenes: bodies, tools and devices, as read from a file."""

from palpate.scene.build import BuiltBody, BuiltScene, mesh_of_body, unsolved_body
from palpate.scene.dynamics import BodyMotion, StrikeTable
from palpate.scene.scene import MODES, TOOLS, YOUNGS_MODULUS, Scene, model_scene
from palpate.scene.tables import MOST_FRICTION, DeviceTable, ToolTable
