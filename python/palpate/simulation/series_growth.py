"""Series beyond small strain of a simulation: computed beside its loop, or waited for by scripts."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from palpate import _native
from palpate.green.background_series import BackgroundSeries
from palpate.green.series import SeriesJob
from palpate.progress import progress_reporter
from palpate.scene.series import TITLE, series_jobs
from palpate.simulation.about import series_text
from palpate.simulation.adjustable import Adjustable


class SeriesGrowth(Adjustable):
    """The series of the bodies of a simulation, where their scene has series."""

    _running: bool
    _editing: threading.RLock
    _background: BackgroundSeries | None = None

    @property
    def series(self) -> BackgroundSeries | None:
        """What is computed of the series beyond small strain beside the loop; None while nothing is."""
        return self._background

    def _missing_series(self) -> list[SeriesJob]:
        """Series that are not known at all places yet, of bodies whose Green's function is complete."""
        missing = []
        for body in self.bodies:
            radii = [radius for radius, known in body.series if known is None or not known.is_complete]
            if not body.is_growing:
                missing += series_jobs(body, radii)
        return missing

    def complete_series(self, progress: bool | Callable[[int, int], None] = True) -> None:
        """Compute the series of all bodies at all places, or wait until another process has: scripts do.

        Raises
        ------
        Error
            A body that is not held.

        """
        for job in self._missing_series():
            with progress_reporter(TITLE, progress) as report:
                self._take_series(job, job.compute(report))

    def _prepare_script(self) -> None:
        """Make ready what ticks of a script need: the same script has the same forces."""
        self._arm_strain_limit()
        self.complete_series()

    def _begin_series(self) -> None:
        """Compute what is missing beside the loop, near the tools first."""
        jobs = self._missing_series()
        if jobs:
            self._background = BackgroundSeries(jobs, self._take_series, self._pressed_place)

    def _continue_series(self) -> None:
        """Compute what bodies lack that have come, or whose Green's function has become complete."""
        background = self._background
        if self._running and (background is None or not background.add(self._missing_series())):
            # It has ended: nothing waits for the thread that changes the scene.
            self._end_series()
            self._begin_series()

    def _end_series(self) -> None:
        background, self._background = self._background, None
        if background is not None:
            background.close()

    def _offer_series(self) -> None:
        """Hand what is known over again, to a loop whose bodies or tools have changed."""
        for rank, body in enumerate(self.bodies):
            for radius, known in body.series:
                if known is not None:
                    _native.set_series(self._core, rank, radius, known)

    def _take_series(self, job: SeriesJob, series: _native.Series) -> None:
        with self._editing:
            rank = self._rank_of_job(job)
            if rank is None:
                return
            _native.set_series(self._core, rank, job.radius, series)
            body = self.bodies[rank]
            known = tuple((radius, series if radius == job.radius else old) for radius, old in body.series)
            bodies = list(self.bodies)
            bodies[rank] = replace(body, series=known)
            self.bodies = tuple(bodies)

    def _hold_series(self) -> dict[str, str]:
        """Have the loop take up no more until the recording ends; return the text about what it has."""
        known: list[list[tuple[float, list[bool]]]] = [[] for _ in self.bodies]
        for tool, body, blocks in _native.hold_series(self._core, True):
            radius = float(self.scene.tools[tool].radius)
            if radius not in [of for of, _ in known[body]]:
                known[body].append((radius, blocks))
        return {"series": series_text(known)}

    def _rank_of_job(self, job: SeriesJob) -> int | None:
        keys = [body.green.key for body in self.bodies]
        return keys.index(job.key) if job.key in keys else None

    def _pressed_place(self, job: SeriesJob) -> tuple[float, float, float] | None:
        """Position of a tool of the job's radius, in the frame of its body, m."""
        rank = self._rank_of_job(job)
        if rank is None:
            return None
        places = [place for _, place in _native.tool_positions(self._core)]
        if not places:
            return None
        inside = self.bodies[rank].points_to_body(np.array(places))
        x, y, z = inside[0].tolist()
        return x, y, z
