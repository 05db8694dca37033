"""Ticks that are timed, and the rows of their figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate.simulation import Simulation
from palpate.validation.ticks import UPRIGHT, Times, tick_times, time_loop


@dataclass(frozen=True)
class Row:
    """One kind of tick, us.

    Attributes
    ----------
    table, labels
        Where the row stands, and what distinguishes it there.
    median, p999, worst
        Of all plays; None where only shortest times count.
    shortest, mean, costliest
        Of the shortest time of each tick over its plays: the median, the mean over places of the longest one there, and
        the largest; None for a running loop.
    beside
        Other figures of the same run.

    """

    table: str
    labels: dict[str, Any]
    median: float
    p999: float | None = None
    worst: float | None = None
    shortest: float | None = None
    mean: float | None = None
    costliest: float | None = None
    beside: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, table: str, labels: dict[str, Any], times: np.ndarray, places: int, beside: Mapping[str, float]) -> Row:
        """Sum up times (plays, ticks), us, as many ticks at every place."""
        of_all, shortest = Times.of(times), times.min(axis=0)
        by_place = shortest.reshape(places, -1).max(axis=1)
        of_shortest = (float(np.median(shortest)), float(by_place.mean()), float(by_place.max()))
        return cls(table, labels, of_all.median, of_all.p999, of_all.worst, *of_shortest, dict(beside))

    def belongs_to(self, table: str, labels: Mapping[str, Any]) -> bool:
        """Whether the row is one of a table with these labels."""
        return self.table == table and labels.items() <= self.labels.items()


@dataclass(frozen=True)
class Play:
    """Ticks that are timed.

    Attributes
    ----------
    simulation, path
        Loop, and positions of its tools, (ticks, tools, 3) m.
    kinds
        Name of each tick; those without one are left out.
    plays, places
        How often the path is played, and of how many equal parts it consists, one a place.
    at_once
        Whether each place is played so often before the next, its entries still in the caches.
    orientation
        Of all tools.
    beside
        Figures of the same run.
    seconds
        How long the running loop is timed along the path; 0: it is not.

    """

    simulation: Simulation
    path: np.ndarray
    kinds: Sequence[str]
    plays: int
    places: int = 1
    at_once: bool = False
    orientation: Sequence[float] = UPRIGHT
    beside: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass(frozen=True)
class Case:
    """Rows of one simulation: their table, what distinguishes them, and the function that prepares them."""

    table: str
    labels: dict[str, Any]
    prepare: Callable[[], Play]

    def measure(self) -> list[Row]:
        """Play, and run the loop."""
        play = self.prepare()
        times, kinds = _times(play), np.array(play.kinds)
        rows = [
            Row.of(self.table, {**self.labels, "tick": kind}, times[:, kinds == kind], play.places, play.beside)
            for kind in dict.fromkeys(play.kinds)
            if kind
        ]
        if play.seconds:
            loop = time_loop(play.simulation, play.path, play.seconds)
            for name, of_loop, missed in (
                ("running: computing", loop.compute_us, loop.missed_computing),
                ("running: waking up", loop.wakeup_us, loop.missed_waking),
            ):
                labels, of_all = {**self.labels, "tick": name}, Times.of(of_loop)
                rows.append(
                    Row(self.table, labels, of_all.median, of_all.p999, of_all.worst, beside={"missed": missed})
                )
        return rows


def _times(play: Play) -> np.ndarray:
    """Play: times of all plays, (plays, ticks) us."""
    if not play.at_once:
        return tick_times(play.simulation, play.path, play.plays, play.orientation)
    parts = np.split(play.path, play.places)
    path = np.ascontiguousarray(np.concatenate([part for part in parts for _ in range(play.plays)]))
    times = tick_times(play.simulation, path, 1, play.orientation).reshape(play.places, play.plays, -1)
    return times.transpose(1, 0, 2).reshape(play.plays, -1)
