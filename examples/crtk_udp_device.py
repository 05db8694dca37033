"""A device of another program or machine by UDP, in the words of CRTK: `measured_cp` comes in, `servo_cf` goes out.

A datagram is JSON with the fields of geometry_msgs: `{"measured_cp": {"position": {"x": ...}, "orientation": ...},
"measured_cv": {"linear": ..., "angular": ...}, "buttons": 1}` with m, a quaternion, m/s, rad/s, bits; the answer is
`{"servo_cf": {"force": {"x": ...}, "torque": ...}}` with N, N m, sent to whoever measured last.

Usage: crtk_udp_device.py listen [PORT]; without an argument it drives itself, and checks the force.
"""

import json
import socket
import sys
import threading
import time
from pathlib import Path

import palpate

PORT = 12121
LONGEST_SILENCE = 0.5  # s


def numbers(message, names="xyz"):
    """Numbers of a vector, or of a quaternion in the order of `names`."""
    return tuple(message[name] for name in names)


class CrtkUdpDevice(palpate.Device):
    """A peer that sends what it measures to a port, and puts out what it is answered."""

    name = "CRTK by UDP"
    limits = palpate.DeviceLimits(max_stiffness=500.0, max_damping=2.0, delay=0.002)

    def __init__(self, port=PORT):
        self.port, self.peer, self.reading, self.heard = port, None, None, 0.0

    def open(self):
        """Listen on this machine; for another one than this give an address of a network that you trust."""
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", self.port))
        self.socket.setblocking(False)

    def read(self):
        """Take the latest measurement of those that have come; a peer that falls silent is a fault."""
        latest = None
        try:
            while True:
                latest, self.peer = self.socket.recvfrom(4096)
        except BlockingIOError:
            pass
        if latest is not None:
            message, self.heard = json.loads(latest), time.monotonic()
            pose, moves = message["measured_cp"], message.get("measured_cv")
            velocities = (numbers(moves["linear"]), numbers(moves["angular"])) if moves else ()
            where = numbers(pose["position"]), numbers(pose["orientation"], "wxyz")
            self.reading = palpate.Reading(*where, *velocities, buttons=message.get("buttons", 0))
        elif self.reading is not None and time.monotonic() - self.heard > LONGEST_SILENCE:
            raise TimeoutError("no measured_cp for half a second: is the peer still there?")
        return self.reading

    def write(self, force, torque):
        """Answer whoever measured last."""
        if self.peer is not None:
            vectors = {"force": force, "torque": torque}
            wrench = {name: dict(zip("xyz", map(float, v), strict=True)) for name, v in vectors.items()}
            self.socket.sendto(json.dumps({"servo_cf": wrench}).encode(), self.peer)

    def close(self):
        """Give the port back."""
        self.socket.close()


def press(port, start, depth, answers, seconds=1.5):
    """Play a peer that comes down within half the time and then stays; keeps the answers."""
    peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    peer.setblocking(False)
    upright, begun = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}, time.monotonic()
    while (now := time.monotonic() - begun) < seconds:
        place = {**start, "z": start["z"] - depth * min(1.0, 2.0 * now / seconds)}
        message = {"measured_cp": {"position": place, "orientation": upright}}
        peer.sendto(json.dumps(message).encode(), ("127.0.0.1", port))
        time.sleep(0.002)
        try:
            answers.append(json.loads(peer.recv(4096))["servo_cf"]["force"]["z"])
        except BlockingIOError:
            continue
    peer.close()


scene = palpate.Scene.read(Path(__file__).with_name("block.toml"))
if sys.argv[1:2] == ["listen"]:
    with palpate.Simulation(scene, devices={0: CrtkUdpDevice(*map(int, sys.argv[2:3]))}) as simulation:
        while True:
            time.sleep(0.5)
            frame = simulation.frame()
            print(f"\r{frame.forces[0].round(3)} N {frame.statistics['fault'] or '':80s}", end="", flush=True)

built = scene.build()
top = built.bodies[0].green.surface_positions.max(axis=0)[2]
start = {"x": 0.03, "y": 0.025, "z": top + scene.tools[0].radius + 0.002}
forces: list[float] = []
with palpate.Simulation(built, devices={0: CrtkUdpDevice()}) as simulation:
    peer = threading.Thread(target=press, args=(PORT, start, 0.005, forces))
    peer.start()
    peer.join()
    pressed = simulation.frame()
    time.sleep(2 * LONGEST_SILENCE)
    silent = simulation.frame().statistics["fault"]
print(f"{len(forces)} answers, the last {forces[-1]:.3f} N, the body's {pressed.forces[0][2]:.3f} N; then: {silent}")
assert forces[0] == 0.0 and abs(forces[-1] - pressed.forces[0][2]) < 0.02 * forces[-1], "the peer feels the body"
assert "no measured_cp for half a second" in silent
