"""Palpation by a protocol instead of a hand: stiffness over the surface of a body, and hidden nodules."""

from palpate.palpation.detection import Detection, compare, homogeneous
from palpate.palpation.records import Nodule, PressCurve
from palpate.palpation.stiffness_map import StiffnessMap, stiffness_map

__all__ = ["Detection", "Nodule", "PressCurve", "StiffnessMap", "compare", "homogeneous", "stiffness_map"]
