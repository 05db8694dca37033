"""The force loop of a scene, its frames, logs and recordings."""

from palpate.simulation.about import scene_of, shown_of
from palpate.simulation.frame import BodyFrame, Contact, Frame, frame_of
from palpate.simulation.packed import pack
from palpate.simulation.recording import CONTACT_DTYPE, Recording, RecordingStatus, require_new_recording
from palpate.simulation.replay import Difference, Replayed, replay, simulation_of, ticks_before_gap
from palpate.simulation.replayed import ReplayedSimulation
from palpate.simulation.sensor import Sensor, SensorContacts
from palpate.simulation.simulation import Simulation

__all__ = [
    "CONTACT_DTYPE",
    "BodyFrame",
    "Contact",
    "Difference",
    "Frame",
    "Recording",
    "RecordingStatus",
    "Replayed",
    "ReplayedSimulation",
    "Sensor",
    "SensorContacts",
    "Simulation",
    "frame_of",
    "pack",
    "replay",
    "require_new_recording",
    "scene_of",
    "shown_of",
    "simulation_of",
    "ticks_before_gap",
]
