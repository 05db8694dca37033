"""The force loop of a scene, what is read of it, and what it leaves behind."""

from palpate.simulation.frame import BodyFrame, Contact, Frame
from palpate.simulation.recording import Recording
from palpate.simulation.simulation import Simulation

__all__ = ["BodyFrame", "Contact", "Frame", "Recording", "Simulation"]
