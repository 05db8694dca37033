"""Series beyond small strain, computed in child processes beside a running force loop."""

from __future__ import annotations

import contextlib
import json
import math
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Sequence

from palpate import _native
from palpate.green.background import NICEST
from palpate.green.child_process import end_child, send_job, send_line, start_child
from palpate.green.series import SeriesJob

# Between two looks at the file and at the tools, s.
PAUSE = 0.1


class BackgroundSeries:
    """Series that grow in their files, one after the other: places near a tool come first.

    A process of the lowest priority computes them. It ends with the program that started it, however that ends; what it
    has finished is found again.

    Parameters
    ----------
    jobs
        What is computed.
    take
        Called on another thread with a job and its series, whenever more of it is known.
    near
        Returns the point of the body, m, near which a tool is, for a job; None for none.

    Attributes
    ----------
    error
        Why it has ended before all are; None while it has not.

    """

    def __init__(
        self,
        jobs: Sequence[SeriesJob],
        take: Callable[[SeriesJob, _native.Series], None],
        near: Callable[[SeriesJob], tuple[float, float, float] | None] = lambda _: None,
    ):
        self.error: str | None = None
        self._jobs, self._take, self._near = list(jobs), take, near
        self._counts = [(0, 0) for _ in jobs]
        self._adding = threading.Lock()
        self._began: tuple[float, int] | None = None
        self._closing, self._ended = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="palpate-series", daemon=True)
        self._thread.start()

    @property
    def done(self) -> int:
        """Places that are computed."""
        return sum(done for done, _ in self._counts)

    @property
    def places(self) -> int:
        """Places of all the jobs that have begun."""
        return sum(places for _, places in self._counts)

    @property
    def is_complete(self) -> bool:
        """Whether all has been computed and taken."""
        return self._ended.is_set() and self.error is None

    @property
    def seconds_left(self) -> float | None:
        """Until the present job is computed, by the places so far, s; None while that is not known."""
        began, done = self._began, self.done
        if began is None or self._ended.is_set() or done <= began[1]:
            return None
        return (time.monotonic() - began[0]) * (self.places - done) / (done - began[1])

    def add(self, jobs: Sequence[SeriesJob]) -> bool:
        """Compute these too, if they are new; whether it still computes."""
        with self._adding:
            known = {(job.key, job.radius) for job in self._jobs}
            new = [job for job in jobs if (job.key, job.radius) not in known]
            self._jobs += new
            self._counts += [(0, 0) for _ in new]
            return not self._ended.is_set()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until it has ended, for at most so many seconds; whether all is computed."""
        self._ended.wait(seconds)
        return self.is_complete

    def close(self) -> None:
        """End the process; what it has finished stays in the file."""
        self._closing.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        number = 0
        try:
            while not self._closing.is_set() and self.error is None:
                self._compute(number, self._jobs[number])
                number += 1
                with self._adding:
                    if number == len(self._jobs):
                        self._ended.set()
                        break
        except Exception as error:
            self.error = self.error or f"{type(error).__name__}: {error}"
        finally:
            self._ended.set()

    def _compute(self, number: int, job: SeriesJob) -> None:
        file = job.file()
        seen = self._look(number, file, None)
        if self._counts[number][0] == self._counts[number][1] > 0:
            return
        child = start_child("series")
        assert child.stdin is not None and child.stdout is not None
        listener = threading.Thread(target=self._listen, args=(number, child.stdout), daemon=True)
        listener.start()
        try:
            with contextlib.suppress(OSError):
                send_job(child.stdin, _arguments(job))
            last = None
            while child.poll() is None and not self._closing.wait(PAUSE):
                last = self._steer(job, last, child)
                seen = self._look(number, file, seen)
        finally:
            end_child(child)
            listener.join()
            child.stdout.close()
        self._look(number, file, seen)
        if self.error is None and not self._closing.is_set() and self._counts[number][0] < self._counts[number][1]:
            self.error = "the process that computes the series has ended"

    def _steer(
        self, job: SeriesJob, last: tuple[float, ...] | None, child: subprocess.Popen[bytes]
    ) -> tuple[float, ...] | None:
        """Send the point near which a tool is, when it has moved by more than its radius."""
        point = self._near(job)
        if point is None or (last is not None and math.dist(point, last) < job.radius):
            return last
        assert child.stdin is not None
        with contextlib.suppress(OSError):  # it has ended meanwhile
            send_line(child.stdin, list(point))
        return point

    def _look(self, number: int, file: _native.SeriesFile, seen: tuple[int, int] | None) -> tuple[int, int] | None:
        """Take what is in the file, if that has changed; return what tells this state of the file from others."""
        try:
            status = file.path.stat()
        except OSError:
            return seen
        now = status.st_ino, status.st_mtime_ns
        if now == seen:
            return seen
        series = file.load()
        if series is not None:
            self._counts[number] = (max(series.done, self._counts[number][0]), series.places)
            self._take(self._jobs[number], series)
        return now

    def _listen(self, number: int, lines: Iterable[bytes]) -> None:
        for line in lines:
            message = json.loads(line)
            if "done" in message:
                # The time left follows from places that come one after the other, not from the factor before them.
                if self._began is None and message["done"] > self._counts[number][0]:
                    self._began = (time.monotonic(), self.done)
                self._counts[number] = (message["done"], message["places"])
            elif "error" in message:
                self.error = message["error"]


def _arguments(job: SeriesJob) -> dict[str, object]:
    ours = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    return {
        "problem": job.problem,
        "laws": job.laws,
        "radius": job.radius,
        "store": job.store,
        "key": job.key,
        "nice": NICEST,
        # One processor is left to the loop.
        "cpus": ours[1:] or ours,
    }
