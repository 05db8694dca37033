"""OpenIGTLink: tool poses of trackers and 3D Slicer in; poses, contacts and forces out.

``messages`` packs and reads messages, ``axes`` converts to millimetres and the patient's axes, ``peer`` is one
connection with bounded memory, ``server`` the thread that serves them all, ``link`` what it does with a simulation.
"""

from palpate.openigtlink.axes import Axes
from palpate.openigtlink.link import Link
from palpate.openigtlink.server import LinkServer
