"""Replay of recordings: tick by tick with the differences, and as a simulation at any tick."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native
from palpate.errors import SceneError
from palpate.progress import progress_reporter
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_whole_series
from palpate.simulation.about import measured_by_surface, require_same, scene_of, with_recorded_series
from palpate.simulation.frame import PERCENTILES, Frame, frame_of
from palpate.simulation.native import assume_recorded
from palpate.simulation.recording import LOG_DTYPE, Recording
from palpate.simulation.simulation import Simulation

# Ticks between two reports of progress.
STEP = 1000
# Differences that are kept: the first is the one to look at.
MOST_DIFFERENCES = 100
# Ticks between two looks at the clock.
SLICE = 50
# Rows of the log are kept this long before the latest tick, s.
LOG_SECONDS = 10.0


@dataclass(frozen=True)
class Difference:
    """A quantity that differs from the recorded one.

    Attributes
    ----------
    tick
        Since the recording began.
    of
        ``"tool 0"``, ``"body 1"``; empty for what is of the whole scene.
    quantity
        What it is.
    recorded, replayed
        Its numbers then and now.

    """

    tick: int
    of: str
    quantity: str
    recorded: tuple[float, ...]
    replayed: tuple[float, ...]

    def __str__(self) -> str:
        of = f"{self.of}: " if self.of else ""
        numbers = [" ".join(f"{number:.17g}" for number in row) or "none" for row in (self.recorded, self.replayed)]
        return f"tick {self.tick}: {of}{self.quantity} was {numbers[0]}, is {numbers[1]}"


@dataclass(frozen=True)
class Replayed:
    """A recording made again.

    Attributes
    ----------
    ticks
        How many were made.
    differences
        The first of them, in the order of ticks; none if every bit is the same.
    whole
        Whether the recording is: none were dropped, and its file was not cut short.
    longest_us
        Time of its thread that the longest tick took, us: what other programs took of the processor is not in it.

    """

    ticks: int
    differences: tuple[Difference, ...]
    whole: bool
    longest_us: float

    @property
    def same(self) -> bool:
        """Whether every bit is."""
        return not self.differences


def built_scene_of(recording: Recording, scene: Scene | BuiltScene | None = None) -> BuiltScene:
    """Build the scene of a recording, or one that should give the same.

    Raises Error for bodies that cannot be built, or are not those of the recording.
    """
    given = scene_of(dict(recording.about)) if scene is None else scene
    built = with_whole_series(given if isinstance(given, BuiltScene) else given.build(), True)
    require_same(dict(recording.about), built)
    return with_recorded_series(dict(recording.about), built)


def simulation_of(recording: Recording, scene: Scene | BuiltScene | None = None) -> Simulation:
    """Build the simulation that made a recording, or that of a scene which should give the same.

    Raises the errors of :func:`built_scene_of`.
    """
    simulation = Simulation(built_scene_of(recording, scene))
    _behave_as_recorded(simulation, recording)
    return simulation


def _behave_as_recorded(simulation: Simulation, recording: Recording) -> None:
    """Measure strain, and take the devices to be, as when the recording was made."""
    simulation._by_surface = measured_by_surface(recording.about)
    simulation._arm_strain_limit()
    assume_recorded(simulation._core, recording.about)


def replay(
    recording: Recording | str | os.PathLike[str],
    scene: Scene | BuiltScene | None = None,
    progress: bool | Callable[[int, int], None] = False,
) -> Replayed:
    """Make a recording again and compare every bit of every tick.

    Parameters
    ----------
    recording
        The recording, or its file.
    scene
        The scene that should give the same; None takes that of the recording.
    progress
        Shown, or called with done and expected ticks.

    Raises
    ------
    Error
        A file that is no recording, or bodies that are not those of the recording.

    """
    recorded = recording if isinstance(recording, Recording) else Recording.load(Path(recording))
    again = _native.Replay(simulation_of(recorded, scene)._core, recorded.source)
    expected = ticks_before_gap(recorded)
    differences: list[Difference] = []
    done = 0
    with progress_reporter("replaying", progress) as report:
        while done < expected:
            ticks, found = again.step(min(STEP, expected - done))
            room = MOST_DIFFERENCES - len(differences)
            differences += [Difference(*of[:3], *map(tuple, of[3:])) for of in found[:room]]
            done += ticks
            if ticks == 0:
                break
            if report is not None:
                report(done, expected)
    whole = recorded.dropped == 0 and expected == len(recorded.ticks)
    return Replayed(done, tuple(differences), whole, again.longest_us)


def ticks_before_gap(recording: Recording) -> int:
    """Count the ticks before the first that was dropped, behind which nothing can be made again."""
    missing = np.flatnonzero(recording.ticks != np.arange(len(recording.ticks)))
    return int(missing[0]) if len(missing) else len(recording.ticks)


class ReplayedSimulation(Simulation):
    """Frames and log of a recording, as those of a running loop; commands have no effect on them.

    Parameters
    ----------
    recorded
        The recording.
    scene
        The scene that should give the same; None takes that of the recording.

    Attributes
    ----------
    scene_as_built
        The scene that computes it again.
    ticks
        Ticks of the recording that can be computed again.
    ticks_done
        How many of them have been made, up to the one that is shown.
    checked
        How many have been compared with what was recorded.
    restarts
        How often it went back: only from the first tick can the others be made.
    difference
        The first; None if so far every bit is the same.

    Raises
    ------
    Error
        A recording without a tick, or of bodies that cannot be built or are others now.

    """

    def __init__(self, recorded: Recording, scene: Scene | BuiltScene | None = None):
        self.scene_as_built = built_scene_of(recorded, scene)
        super().__init__(self.scene_as_built)
        _behave_as_recorded(self, recorded)
        self.recorded, self.ticks = recorded, ticks_before_gap(recorded)
        if self.ticks == 0:
            raise SceneError("the recording has no tick that can be computed again")
        self.checked, self.restarts = 0, 0
        self.difference: Difference | None = None
        # Of all ticks: what computing took then, not now.
        self._timing = {"compute_us": _percentiles(recorded.compute_us), "wakeup_us": _percentiles(recorded.wakeup_us)}
        self._begin()
        self.advance(1, 0.0)

    def _begin(self) -> None:
        self._again = _native.Replay(self._core, self.recorded.source)
        self.ticks_done = 0
        self._rows: list[np.ndarray] = []
        self._frame: Frame | None = None

    def advance(self, tick: int, seconds: float) -> None:
        """Make ticks up to and with the ``tick``-th, counted from 1, for about so many seconds at most."""
        if tick < self.ticks_done:
            self._begin()
            self.restarts += 1
        end = time.monotonic() + seconds
        while self.ticks_done < tick:
            ticks, found = self._again.step(min(SLICE, tick - self.ticks_done))
            if ticks == 0:
                # The file ends here.
                self.ticks = self.ticks_done
                break
            self.ticks_done += ticks
            self._compare(found)
            self._take_log(tick)
            if time.monotonic() > end:
                break

    def _compare(self, found: list[tuple[int, str, str, list[float], list[float]]]) -> None:
        if found and self.difference is None:
            self.difference = Difference(*found[0][:3], *map(tuple, found[0][3:]))
        self.checked = max(self.checked, self.ticks_done)
        self._frame = None

    def _take_log(self, goal: int) -> None:
        rows = np.ascontiguousarray(self._again.drain_log()).view(LOG_DTYPE)
        if goal - self.ticks_done < LOG_SECONDS * self.scene.device.rate:
            self._rows.append(rows)

    def _settings(self) -> dict[str, Any]:
        return self._again.settings()

    @property
    def watched(self) -> tuple[int, int] | None:
        """Body and rank of the surface node that was watched at the tick that is shown."""
        return self._again.settings()["watched"]

    def frame(self) -> Frame:
        """Read the latest tick that was made; its timing is that of the recording."""
        if self._frame is None:
            raw = {**self._again.frame(), "ticks": self.ticks_done, **self._timing}
            self._frame = self._flagged(frame_of(raw, self.bodies), self.bodies)
        return self._frame

    def _read_frame(self) -> Frame:
        return self.frame()

    def drain_log(self) -> np.ndarray:
        """Rows since the last call, none older than :data:`LOG_SECONDS` where many ticks were made at once."""
        rows = np.concatenate([np.empty(0, LOG_DTYPE), *self._rows])
        self._rows = []
        ticks = np.rint(rows["time"] * self.scene.device.rate).astype(int) - 1
        known = (ticks >= 0) & (ticks < len(self.recorded.compute_us))
        rows["compute_us"][known] = self.recorded.compute_us[ticks[known]]
        return rows

    def watch(self, node: int, body: int = 0) -> None:
        """Nothing: what was watched is in the recording."""

    def set_time_scale(self, time_scale: float) -> None:
        """Nothing: it is in the recording."""


def _percentiles(microseconds: np.ndarray) -> list[float]:
    found: Any = np.percentile(microseconds, [50, 99, 99.9, 100])
    assert len(found) == len(PERCENTILES)
    return found.tolist()
