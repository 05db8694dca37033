"""The force loop of a scene, what is read of it, and what it leaves behind."""

from palpate.simulation.frame import Contact, Frame
from palpate.simulation.recording import RATE, Recording
from palpate.simulation.simulation import Simulation
from palpate.simulation.strain_limit import LimitedTool

__all__ = ["RATE", "Contact", "Frame", "LimitedTool", "Recording", "Simulation"]
