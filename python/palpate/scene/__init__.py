"""Scene files: what to touch, and with what."""

from palpate.scene.scene import BuiltScene, Scene

__all__ = ["BuiltScene", "Scene"]
