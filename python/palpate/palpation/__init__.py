"""Palpation by a protocol instead of a hand: stiffness over the surface of a body, and what lies hidden in it."""

from palpate.palpation.detection import Detection, Nodule, compare, homogeneous
from palpate.palpation.stiffness_map import PressCurve, StiffnessMap, stiffness_map

__all__ = [
    "Detection",
    "Nodule",
    "PressCurve",
    "StiffnessMap",
    "compare",
    "homogeneous",
    "stiffness_map",
]
