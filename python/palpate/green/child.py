"""Child process that computes columns beside a running force loop: ``python -m palpate.green.child``.

After the job it is given the nodes of every region that is to come next. What is finished stays in the partial file.
"""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path

from palpate import _native
from palpate.errors import Error
from palpate.green.child_process import compute_and_exit, progress_sender, received_job, received_lines, send
from palpate.green.claim import claimed


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


def main() -> None:
    """Compute what standard input asks for."""
    arguments = received_job()
    growth = (arguments.pop("first"), _NextNodes().take, lambda nodes: send(ready=nodes))
    key, path = arguments.pop("key"), arguments["path"]

    def compute() -> None:
        with claimed(path, _StoreWatch(path)) as claim:
            if not _is_finished(path, key):
                progress = progress_sender("columns")
                _native.GreenCore.precompute_to(**arguments, progress=progress, growth=growth, claim=claim)

    compute_and_exit(compute, path)


if __name__ == "__main__":
    main()
