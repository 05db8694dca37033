"""Replay of recordings tick by tick, and the differences."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate import _native
from palpate.progress import progress_reporter
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_whole_series
from palpate.simulation.about import measured_by_surface, require_same, scene_of, with_recorded_series
from palpate.simulation.connecting import assume_recorded
from palpate.simulation.recording import Recording
from palpate.simulation.simulation import Simulation

# Ticks between two reports of progress.
STEP = 1000
# Differences that are kept: the first is the one to look at.
MOST_DIFFERENCES = 100


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
    simulation._by_surface = measured_by_surface(recording.about)
    simulation._arm_strain_limit()
    assume_recorded(simulation._core, recording.about)
    return simulation


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
