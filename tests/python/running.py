"""Waits for a running loop that end by what is seen: on a busy machine a fixed time may be too short."""

from __future__ import annotations

import time

import numpy as np

import palpate

# Without what is waited for this long a test fails, s.
PATIENCE = 60.0
# Tools that moved less than `STILL`, m, in so many ticks have arrived: the hand's time constant is 8 ms.
TICKS_APART, STILL = 30, 1e-9


def settle(simulation: palpate.Simulation, condition=lambda frame: True) -> palpate.Frame:
    """Latest frame in which a condition holds and all tools have come to rest."""
    end, before = time.monotonic() + PATIENCE, simulation.frame()
    while time.monotonic() < end:
        time.sleep(0.02)
        frame = simulation.frame()
        if frame.statistics["ticks"] - before.statistics["ticks"] < TICKS_APART:
            continue
        still = frame.positions.shape == before.positions.shape and np.allclose(
            frame.positions, before.positions, rtol=0, atol=STILL, equal_nan=True
        )
        before = frame
        if still and condition(frame):
            return frame
    raise AssertionError(f"did not settle: {frame.positions} {frame.forces} {frame.contacts} {frame.statistics}")
