"""Finite elements you can feel: soft bodies for haptics.

SI units everywhere: m, N, Pa, kg, s. Nodes are 0-based; arrays are C-ordered.
"""

# ruff: noqa: E402  the imports below take a second
from palpate.startup import end_quietly_when_interrupted

end_quietly_when_interrupted()

from importlib.metadata import version

from palpate import models, palpation
from palpate.body import Body, Loads, Material
from palpate.devices import Device, DeviceLimits, Reading
from palpate.dynamics import Energy, ModalBasis, Newmark, modes, rayleigh_from_ratios
from palpate.errors import (
    BodyError,
    ClusterError,
    DeviceError,
    DeviceWarning,
    Error,
    FitError,
    LockingWarning,
    MeshError,
    MeshWarning,
    PalpateWarning,
    PrecisionError,
    PrecisionWarning,
    RecordingWarning,
    SceneError,
    SchedulingWarning,
    SimulationError,
    StoreError,
    StoreWarning,
    TouchWarning,
    UnclearUnitError,
    UnitError,
    ViewerError,
)
from palpate.fields import StressRecovery, SurfaceStress
from palpate.fitting import Fit, FittedParameter, Indentations, fit
from palpate.green import Answer, GreensFunction, Plan, Touch, plan, precompute
from palpate.mesh import TetMesh, shapes, tetrahedralize
from palpate.scene import Scene
from palpate.sessions import Comparison, QuantityDifference, compare, export, rerun
from palpate.simulation import (
    Contact,
    Difference,
    Frame,
    Recording,
    RecordingStatus,
    Replayed,
    Sensor,
    SensorContacts,
    Simulation,
    pack,
    replay,
)
from palpate.viewer.widget import widget

__version__ = version("palpate")

__all__ = [
    "Answer",
    "Body",
    "BodyError",
    "ClusterError",
    "Comparison",
    "Contact",
    "Device",
    "DeviceError",
    "DeviceLimits",
    "DeviceWarning",
    "Difference",
    "Energy",
    "Error",
    "Fit",
    "FitError",
    "FittedParameter",
    "Frame",
    "GreensFunction",
    "Indentations",
    "Loads",
    "LockingWarning",
    "Material",
    "MeshError",
    "MeshWarning",
    "ModalBasis",
    "Newmark",
    "PalpateWarning",
    "Plan",
    "PrecisionError",
    "PrecisionWarning",
    "QuantityDifference",
    "Reading",
    "Recording",
    "RecordingStatus",
    "RecordingWarning",
    "Replayed",
    "Scene",
    "SceneError",
    "SchedulingWarning",
    "Sensor",
    "SensorContacts",
    "Simulation",
    "SimulationError",
    "StoreError",
    "StoreWarning",
    "StressRecovery",
    "SurfaceStress",
    "TetMesh",
    "Touch",
    "TouchWarning",
    "UnclearUnitError",
    "UnitError",
    "ViewerError",
    "compare",
    "export",
    "fit",
    "models",
    "modes",
    "pack",
    "palpation",
    "plan",
    "precompute",
    "rayleigh_from_ratios",
    "replay",
    "rerun",
    "shapes",
    "tetrahedralize",
    "widget",
]
