"""Precomputation in a child process, while the region that was computed first can be touched."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from palpate import _native
from palpate.body import Body, SurfaceRegion, surface_region
from palpate.errors import BodyError, StoreError, StoreWarning
from palpate.green.bounds import CHOSEN
from palpate.green.child_process import end_child, send_job, send_line, start_child
from palpate.green.function import GreensFunction
from palpate.green.job import Job, waiting_message

# The child gives way to everything else once a force loop runs.
NICEST = 19


class BackgroundPrecompute:
    """Green's function that grows in its file.

    The process ends with the program that started it, however that ends; what it has finished is found again.

    Parameters
    ----------
    body, precision, touch, first
        As of :func:`palpate.precompute`.
    path
        The store; None keeps it in the cache.

    Attributes
    ----------
    body
        What is computed.
    done, columns
        Columns that are computed, and in all.
    error
        Why it has ended before all are; None while it has not.

    """

    def __init__(
        self,
        body: Body,
        *,
        first: SurfaceRegion,
        touch: SurfaceRegion | None = None,
        precision: str | None = None,
        path: str | os.PathLike[str] | None = None,
    ):
        self.body = body
        self._job = job = Job.of(body, precision, touch, first, path)
        self.done, self.columns = 0, 3 * len(job.region)
        self.error: str | None = None
        self._unfetched: GreensFunction | None = None
        self._waits = False
        self._complete = job.stored()
        self._changed = threading.Condition()
        self._painted, self._touchable = np.empty(0, np.int64), np.empty(0, np.int64)
        self._began: tuple[float, int] | None = None
        self._child: subprocess.Popen[bytes] | None = None
        if self._complete is not None:
            self.done = self.columns
            return
        with contextlib.suppress(StoreError, OSError):
            # What an interrupted computation had ready can be touched while this one begins.
            self._unfetched = GreensFunction.load(job.target, body=body)
            self._touchable = self._unfetched.touchable_nodes
        memory = job.allowed(None)
        job.make_room()
        self._child = child = start_child("columns")
        assert child.stdin is not None and child.stdout is not None
        self._input = child.stdin
        names = ("arguments", "precision_name", "within", "description", "path", "memory", "first", "key")
        values = (job.problem, precision, CHOSEN, job.description, job.target, memory, job.first, job.key)
        send_job(self._input, dict(zip(names, values, strict=True)))
        self._listener = threading.Thread(
            target=self._listen, args=(child.stdout,), name="palpate-columns", daemon=True
        )
        self._listener.start()

    def _listen(self, lines: Iterable[bytes]) -> None:
        try:
            self._take_messages(lines)
        except Exception as error:
            # Such as a message that is cut short. Without an error, wait() would never return.
            self._finish(f"{type(error).__name__}: {error}")
        self._finish("the process that computes the columns has ended")

    def _take_messages(self, lines: Iterable[bytes]) -> None:
        for line in lines:
            message = json.loads(line)
            if "done" in message:
                self._note_progress(message["done"], message["columns"])
            elif "error" in message:
                self._finish(message["error"])
            elif "waiting" in message:
                self._waits = True
            elif "theirs" in message:
                # Of another body, perhaps.
                with contextlib.suppress(StoreError, OSError):
                    self._accept(GreensFunction.load(self._job.target, body=self.body))
            else:
                self._load(bool(message.get("finished")))

    def _note_progress(self, done: int, columns: int) -> None:
        with self._changed:
            # The time left follows from columns that come one after the other: not from the factorisation before the
            # first of them, nor from what was there already.
            if self._began is None and done > self.done > 0:
                self._began = (time.monotonic(), done)
            self.done, self.columns = done, columns
            self._changed.notify_all()

    def _load(self, finished: bool) -> None:
        try:
            green = self._job.load() if finished else self._job.load_growing()
        except (StoreError, OSError) as error:
            self._finish(str(error))
            return
        # What tools needed to know of the stage before is kept under its name, and of no more use.
        _native.forget_contacts(self._job.target)
        if finished:
            self._job.make_room(written=True)
        self._accept(green, finished)

    def _accept(self, green: GreensFunction, finished: bool = False) -> None:
        with self._changed:
            self._unfetched, self._touchable = green, green.touchable_nodes
            if finished:
                self._complete, self.done = green, self.columns
            self._changed.notify_all()

    def _finish(self, reason: str) -> None:
        with self._changed:
            if self._complete is None:
                self.error = self.error or reason
            self._changed.notify_all()

    @property
    def is_complete(self) -> bool:
        """Whether all columns are computed."""
        return self._complete is not None

    @property
    def region(self) -> np.ndarray:
        """Surface nodes that can be touched once all is computed, ascending."""
        return self._job.region

    @property
    def waiting(self) -> np.ndarray:
        """Nodes that were asked for next and are not ready, ascending."""
        with self._changed:
            return np.setdiff1d(self._painted, self._touchable)

    @property
    def seconds_left(self) -> float | None:
        """Until all is computed, by the columns so far, s; None while that is not known."""
        with self._changed:
            if self._began is None or self.error is not None or self._complete is not None:
                return None
            since, had = self._began
            done = self.done - had
            return (time.monotonic() - since) * (self.columns - self.done) / done if done > 0 else None

    def wait(self, progress: Callable[[int, int], None] | None = None) -> GreensFunction:
        """Wait for the region that is computed first; what it gives may be touched there.

        Raises BodyError if the computation has failed.
        """
        while True:
            with self._changed:
                unfetched = self._complete or self._unfetched
                if unfetched is not None:
                    self._unfetched = None
                    return unfetched
                if self.error is not None:
                    raise BodyError(self.error)
                self._changed.wait(0.1)
                done, columns = self.done, self.columns
                waits, self._waits = self._waits, False
            if waits:
                warnings.warn(waiting_message(self._job.target), StoreWarning, stacklevel=2)
            if progress is not None:
                progress(done, columns)

    def take(self) -> GreensFunction | None:
        """Green's function that has become ready since it was last asked for; None for none."""
        with self._changed:
            unfetched, self._unfetched = self._unfetched, None
            return unfetched

    def paint(self, nodes: Sequence[int] | np.ndarray) -> None:
        """Let surface nodes be the next stage; BodyError for a node that is not on the surface."""
        surface = self.body.mesh.surface_nodes
        wanted = np.intersect1d(surface_region(self.body, np.asarray(nodes), "painted"), self._job.region)
        if self.is_complete or self.error is not None or not len(wanted):
            return
        with contextlib.suppress(OSError, ValueError):  # it has ended or was closed meanwhile
            send_line(self._input, np.searchsorted(surface, wanted).tolist())
            with self._changed:
                self._painted = np.union1d(self._painted, wanted)

    def yield_processor(self) -> None:
        """Leave a processor to a force loop that begins, and compute on the others at the lowest priority."""
        if self._child is None or not hasattr(os, "sched_setaffinity"):
            return
        with self._changed:
            self._began = None  # it is slower from now on
        ours = sorted(os.sched_getaffinity(0))
        with contextlib.suppress(OSError):
            for thread in map(int, os.listdir(f"/proc/{self._child.pid}/task")):
                with contextlib.suppress(OSError):  # one that has ended
                    os.sched_setaffinity(thread, ours[1:] or ours)
                    os.setpriority(os.PRIO_PROCESS, thread, NICEST)

    def close(self) -> None:
        """End the process; what it has finished stays in the partial file."""
        if self._child is None:
            return
        end_child(self._child)
        self._listener.join()
        assert self._child.stdout is not None
        self._child.stdout.close()
