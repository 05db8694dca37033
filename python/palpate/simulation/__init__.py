"""The force loop of a scene, its frames, logs and recordings."""

from palpate.simulation.about import shown_of
from palpate.simulation.frame import BodyFrame, Contact, Frame, frame_of
from palpate.simulation.packed import pack
from palpate.simulation.recording import CONTACT_DTYPE, Recording, RecordingStatus, require_new_recording
from palpate.simulation.replay import Difference, Replayed, ReplayedSimulation, replay, simulation_of, ticks_before_gap
from palpate.simulation.sensor import Sensor, SensorContacts
from palpate.simulation.simulation import Simulation
