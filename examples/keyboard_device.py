"""A device of one's own: the keyboard moves a fingertip, and the force is a bar in the terminal.

Keys: a d left and right, w s away and towards you, r f up and down, space holds on, q ends. Without a terminal it plays
a press by script, and checks the force. A device with motors is the same class with a `write` that drives them.
"""

import contextlib
import sys
import time
from pathlib import Path

import numpy as np

import palpate

STEP = 1e-3  # m a key
FOLLOWING = 0.03  # time constant of the fingertip, s
KEYS = {"a": (-1, 0, 0), "d": (1, 0, 0), "s": (0, -1, 0), "w": (0, 1, 0), "f": (0, 0, -1), "r": (0, 0, 1)}


class KeyboardDevice(palpate.Device):
    """A fingertip that follows the keys smoothly; ``keys()`` returns the characters typed since the last call."""

    name = "keyboard"
    # Without motors nothing limits it, and nothing can oscillate.
    limits = palpate.DeviceLimits(max_torque=0.0)

    def __init__(self, keys, start):
        self.keys, self.target, self.tip = keys, np.array(start, dtype=float), np.array(start, dtype=float)
        self.force, self.holds, self.ended = np.zeros(3), False, False
        self._before = time.monotonic()

    def read(self):
        """Move the fingertip towards what the keys ask for."""
        for key in self.keys():
            self.target += STEP * np.array(KEYS.get(key, (0, 0, 0)))
            self.holds ^= key == " "
            self.ended |= key == "q"
        now = time.monotonic()
        share = 1.0 - np.exp(-(now - self._before) / FOLLOWING)
        velocity = (self.target - self.tip) / FOLLOWING
        self.tip, self._before = self.tip + share * (self.target - self.tip), now
        return palpate.Reading(self.tip, velocity=velocity, buttons=int(self.holds))

    def write(self, force, torque):
        """Keep the force, to be shown: there are no motors."""
        self.force = force


@contextlib.contextmanager
def terminal_keys():
    """Return a function that reads the keys typed in this terminal without waiting."""
    if sys.platform == "win32":
        import msvcrt

        yield lambda: msvcrt.getwch() if msvcrt.kbhit() else ""
        return
    import select
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield lambda: sys.stdin.read(1) if select.select([sys.stdin], [], [], 0)[0] else ""
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def scripted_keys(script, every=0.02):
    """Return a function that types the characters of a script one by one, so many seconds apart."""
    begun, typed = None, 0

    def keys():
        nonlocal begun, typed
        begun = begun or time.monotonic()
        before, typed = typed, int((time.monotonic() - begun) / every)
        return script[before:typed]

    return keys


def run(keys, scene):
    """Run until q is typed; return the largest force and the last one, N."""
    _, _, top = scene.build().bodies[0].green.surface_positions.max(axis=0)
    device = KeyboardDevice(keys, (0.03, 0.025, top + scene.tools[0].radius + 5 * STEP))
    largest = 0.0
    with palpate.Simulation(scene, devices={0: device}) as simulation:
        while not device.ended:
            time.sleep(0.02)
            force = device.force[2]
            largest = max(largest, force)
            print(f"\r{force:6.3f} N {'#' * int(40 * force):60s}", end="", flush=True)
            if fault := simulation.frame().statistics["fault"]:
                sys.exit(f"\n{fault}")
    print()
    return largest, device.force


scene = palpate.Scene.read(Path(__file__).with_name("block.toml"))
if sys.stdin is not None and sys.stdin.isatty():
    print(__doc__)
    with terminal_keys() as keys:
        run(keys, scene)
else:
    # Down to the surface and 3 mm into it, and up again.
    largest, last = run(scripted_keys(8 * "f" + 20 * "." + 10 * "r" + "....q"), scene)
    print(f"largest force {largest:.3f} N")
    assert 0.05 < largest < 5.0, "pressed 3 mm deep, the block pushes up"
    assert not last.any(), "no force is left when the loop has stopped"
