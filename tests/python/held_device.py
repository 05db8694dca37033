"""A device of a program whose tip a hand holds, for tests of what polls and checks devices."""

from __future__ import annotations

import math
import threading
import time

import numpy as np

import palpate


class Held(palpate.Device):
    """A tip in a hand without mass: it yields to a force by `F / STIFFNESS`, after a lag of `LAG`."""

    STIFFNESS, LAG = 100.0, 0.01
    limits = palpate.DeviceLimits(max_force=0.4)

    def __init__(self, sign=1.0):
        self.sign, self.position, self.force, self.when = sign, np.zeros(3), np.zeros(3), time.monotonic()
        self.calls, self.threads, self.written = [], set(), []

    def open(self):
        self.calls.append("open")

    def close(self):
        self.calls.append("close")

    def read(self):
        self.threads.add(threading.current_thread())
        now = time.monotonic()
        share = 1.0 - math.exp((self.when - now) / self.LAG)
        self.position, self.when = self.position + share * (self.force / self.STIFFNESS - self.position), now
        return palpate.Reading(self.position, buttons=4)

    def write(self, force, torque):
        assert force.shape == torque.shape == (3,)
        self.force = self.sign * force
        self.written.append((time.monotonic(), force))


def starved(fault):
    """Whether a fault is that of a program which got no processor for 50 ms: other programs had them all."""
    return fault is not None and "stopped sending measurements" in fault


def unstarved(attempt, tries=5):
    """Make an attempt again while the machine was too busy for it: `attempt` returns its result and a fault or None."""
    for _ in range(tries):
        result, fault = attempt()
        if not starved(fault):
            return result
    raise AssertionError(f"the machine is too busy: {fault}")
