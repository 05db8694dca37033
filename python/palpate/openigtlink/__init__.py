"""OpenIGTLink: tool poses of trackers and 3D Slicer in; poses, contacts and forces out.

``messages`` packs and reads messages, ``server`` is the thread that serves all connections, ``link`` what it does with
a simulation, in millimetres and the patient's axes.
"""

from palpate.openigtlink.link import Axes, Link
from palpate.openigtlink.server import LinkServer
