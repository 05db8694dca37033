"""Child processes that compute beside a running force loop: ``python -m palpate.green.child columns``, or ``series``.

After the job, one of columns is given the nodes of every region that is to come next; what is finished stays in the
partial file. One of a series is given a point, m, whenever a tool has moved: places near the point come first.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from pathlib import Path

from palpate import _native
from palpate.errors import Error
from palpate.green.child_process import compute_and_exit, progress_sender, received_job, received_lines, send
from palpate.green.job import claimed


class _NextNodes:
    """Nodes to be computed next, read from standard input on a thread."""

    def __init__(self):
        self._lock = threading.Lock()
        self._nodes: list[int] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for nodes in received_lines():
            with self._lock:
                self._nodes += nodes

    def take(self) -> list[int] | None:
        """Nodes that have come since, as ranks among the surface nodes; None for none."""
        with self._lock:
            nodes, self._nodes = self._nodes, []
        return nodes or None


class _StoreWatch:
    """Reports that another process computes the store, and what that has ready."""

    def __init__(self, path: Path):
        self._path = path
        self._seen: int | None = None
        self._waits = False

    def __call__(self) -> None:
        if not self._waits:
            self._waits = True
            send(waiting=True)
        with contextlib.suppress(OSError):
            now = self._path.stat().st_ino
            if now != self._seen:
                self._seen = now
                send(theirs=True)


def _is_finished(path: Path, key: str) -> bool:
    """Whether the process that was waited for has finished the store."""
    try:
        _native.GreenCore.load(path, key)
    except (Error, OSError):
        return False
    return True


def _follow(file: _native.SeriesFile) -> None:
    for point in received_lines():
        file.set_near(tuple(point))


def _yield_processor(nice: int, cpus: list[int]) -> None:
    with contextlib.suppress(OSError, AttributeError):
        os.nice(nice)
        os.sched_setaffinity(0, cpus)


def compute_columns() -> None:
    """Compute the columns that standard input asks for."""
    arguments = received_job()
    growth = (arguments.pop("first"), _NextNodes().take, lambda nodes: send(ready=nodes))
    key, path = arguments.pop("key"), arguments["path"]

    def compute() -> None:
        with claimed(path, _StoreWatch(path)) as claim:
            if not _is_finished(path, key):
                progress = progress_sender("columns")
                _native.GreenCore.precompute_to(**arguments, progress=progress, growth=growth, claim=claim)

    compute_and_exit(compute, path)


def compute_series() -> None:
    """Compute the series that standard input asks for."""
    given = received_job()
    _yield_processor(given["nice"], given["cpus"])
    file = _native.SeriesFile(given["laws"], given["radius"], given["store"], given["key"])
    threading.Thread(target=_follow, args=(file,), daemon=True).start()

    def compute() -> None:
        with claimed(file.path, lambda: None):
            file.compute(given["problem"], progress_sender("places"))

    compute_and_exit(compute, given["store"])


if __name__ == "__main__":
    {"columns": compute_columns, "series": compute_series}[sys.argv[1]]()
