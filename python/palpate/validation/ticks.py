"""Computing times of every kind of tick, played from a script, and computing and wake-up times of a running loop.

A script comes down on a place, rests, slides, turns abruptly, and leaves, for many places; all tools do the same at the
same time, so that the costliest kinds fall into one tick. Played offline, a tick's time is that of its thread: what
other programs take does not count, what they leave of the caches does. A running loop is timed as it is.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.body import Body
from palpate.errors import SimulationError
from palpate.green import GreensFunction
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.reference import Block, body_on_table, top_middle, top_nodes

KINDS = ("begin", "held", "sliding", "abrupt", "release")
# How high a tool waits, m: it comes and leaves in a single tick.
CLEAR = 5e-3
# Ticks of each place: at rest, sliding (20 mm/s at 1 kHz), and turning: each goes 0.4 mm back the way that it came,
# and a tenth of that deeper or less deep, as an unsteady hand at 0.4 m/s.
HELD, SLIDING, TURNS = 4, 16, 4
STEP, TURN = 2e-5, 4e-4
# Kind of each tick of a place: a rank in KINDS, -1 for one without a contact.
RANKS = np.array([-1, 0, *[1] * HELD, *[2] * SLIDING, *[3] * TURNS, 4])
# Within so far of the middles of the tools, m.
AROUND = 2.5e-3
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
# Plates: edge of a cell, and radius of the part of the top that may be touched; spheres and their depth; m.
CELL, TOUCHED, RADIUS, DEPTH, FRICTION = 0.005, 0.035, 0.01, 1e-3, 0.3
# A running loop is sent to the next place of the script this often, s.
SEND = 2e-3
# What the loop's clock and the statistics leave out at the start: pages that are touched first, s.
WARM = 0.3


@dataclass(frozen=True)
class Times:
    """Times, us."""

    count: int  # how many there are
    # Half are below, 99.9 % are below, and the largest.
    median: float
    p999: float
    worst: float

    @classmethod
    def of(cls, times: np.ndarray) -> Times:
        """Sum up."""
        return cls(times.size, float(np.median(times)), float(np.quantile(times, 0.999)), float(times.max()))


def plate(cells: tuple[int, int, int]) -> tuple[Body, GreensFunction]:
    """Plate of 4-node tetrahedra held from below, and its Green's function where its top may be touched."""
    body = body_on_table(Block(tuple(CELL * count for count in cells)), cells, quadratic=False)
    return body, green_of(body, touch=top_nodes(body, TOUCHED), precision="f32")


def press_centres(body: Body, shifts: Sequence[Sequence[float]]) -> np.ndarray:
    """Centres of spheres pressed into a plate, (tools, 3) m, shifted by (tools, 2), m, from the middle of its top."""
    return top_middle(body) + [[*shift, RADIUS - DEPTH] for shift in np.asarray(shifts)]


def strokes(along: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Path of a tool over one place, (ticks, 3) m, relative to where it is pressed; kinds as in :data:`RANKS`."""
    slid = STEP * np.arange(SLIDING + 1)[:, None] * along
    back = (np.arange(1, TURNS + 1) % 2)[:, None]
    turned = slid[-1] - TURN * back * (along + 0.1 * normal)
    high = CLEAR * normal
    return np.vstack([high, np.zeros((1 + HELD, 3)), slid[1:], turned, turned[-1] + high])


def script(middles: np.ndarray, places: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Path of tools pressed to ``middles`` (tools, 3), m, along -z, at so many places around: (ticks, tools, 3), m.

    Beside it the kind of each tick, (ticks,): a rank in :data:`KINDS`, -1 for one without a contact.
    """
    random = np.random.default_rng(seed)
    up = np.array([0.0, 0.0, 1.0])
    steps = []
    for shift in random.uniform(-AROUND, AROUND, (places, 2)):
        angle = random.uniform(0, 2 * np.pi)
        steps.append([*shift, 0.0] + strokes(np.array([np.cos(angle), np.sin(angle), 0.0]), up))
    path = middles[None] + np.vstack(steps)[:, None, :]
    return np.ascontiguousarray(path), np.tile(RANKS, places)


def tick_times(
    simulation: Simulation, path: np.ndarray, plays: int, orientation: Sequence[float] = UPRIGHT
) -> np.ndarray:
    """Time each tick of a path (t, tools, 3), m, that is run several times offline: (plays, t) us of its thread.

    Raises SimulationError for a fault that latched within the path.
    """
    orientations = np.broadcast_to(np.array(orientation), (*path.shape[:2], 4)).copy()
    grabs = np.zeros(path.shape[:2], dtype=bool)
    times = []
    for _ in range(plays):
        raw = simulation._core.run(path, orientations, grabs, ([], []), None)
        if raw["fault"] is not None:
            raise SimulationError(raw["fault"])
        times.append(1e-3 * np.array(raw["compute_ns"], dtype=float))
    return np.array(times)


def times_by_kind(times: np.ndarray, kinds: np.ndarray) -> dict[str, Times]:
    """Sum up times (plays, t), us, by the kind of tick."""
    return {name: Times.of(times[:, kinds == rank]) for rank, name in enumerate(KINDS) if (kinds == rank).any()}


@dataclass(frozen=True, eq=False)
class LoopTimes:
    """A running loop, tick by tick."""

    # (ticks,) us.
    compute_us: np.ndarray
    wakeup_us: np.ndarray
    # Deadlines that passed within ticks that took too long, and before ticks that began too late.
    missed_computing: int
    missed_waking: int
    # What the system granted.
    priority: bool
    locked_memory: bool


def time_loop(simulation: Simulation, path: np.ndarray | None, seconds: float, report=None) -> LoopTimes:
    """Run the loop for so many seconds, its tools along a path (t, tools, 3), m, over and over; None leaves them out.

    ``report`` is called with the seconds that have passed, ten times a second.
    """
    rows, period = [], 1.0 / simulation.scene.device.rate
    with simulation:
        _drive(simulation, path, period, 0.0, time.monotonic() + WARM)
        simulation.drain_log()
        before, begun = simulation.frame().statistics, time.monotonic()
        chunks = max(1, round(10 * seconds))
        for chunk in range(chunks):
            end = (chunk + 1) * seconds / chunks
            _drive(simulation, path, period, chunk * seconds / chunks, begun + end)
            rows.append(simulation.drain_log())
            if report is not None:
                report(end)
        after = simulation.frame().statistics
    log = np.concatenate(rows)
    computing, missed = (after[k] - before[k] for k in ("missed_computing", "missed_deadlines"))
    return LoopTimes(log["compute_us"], log["wakeup_us"], computing, missed - computing, *after["realtime"])


def _drive(simulation: Simulation, path: np.ndarray | None, period: float, since: float, end: float) -> None:
    """Send the tools along the path, from ``since`` seconds after its start, until an end by the monotonic clock, s."""
    begun = time.monotonic()
    while (now := time.monotonic()) < end:
        if path is not None:
            places: Sequence = path[int((now - begun + since) / period) % len(path)]
            for tool, place in enumerate(places):
                simulation.move(place, tool=tool)
        time.sleep(min(SEND if path is not None else 0.05, max(0.0, end - now)))
