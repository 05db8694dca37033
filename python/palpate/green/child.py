"""Child process that computes columns beside a running force loop: ``python -m palpate.green.child``.

It is given the problem as a pickle on its standard input, then a line of JSON for every region that is to come next,
and writes a line of JSON on its standard output for whatever has happened. Where its input ends the program that
started it is gone: it ends at once, and what is finished stays in the partial file.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from palpate import _native
from palpate.errors import Error
from palpate.green.claim import claimed


class _NextNodes:
    """Nodes to be computed next, read from standard input on a thread."""

    def __init__(self, stream: BinaryIO):
        self._stream, self._lock = stream, threading.Lock()
        self._nodes: list[int] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._stream:
            with self._lock:
                self._nodes += json.loads(line)
        # Not sys.exit: threads of the computation would be waited for.
        os._exit(0)

    def take(self) -> list[int] | None:
        """Nodes that have come since, as ranks among the surface nodes; None for none."""
        with self._lock:
            nodes, self._nodes = self._nodes, []
        return nodes or None


class _StoreWatch:
    """Reports that another process computes the store, and what that has ready."""

    def __init__(self, path: Path, send: Callable[..., None]):
        self._path, self._send = path, send
        self._seen: int | None = None
        self._waits = False

    def __call__(self) -> None:
        if not self._waits:
            self._waits = True
            self._send(waiting=True)
        with contextlib.suppress(OSError):
            now = self._path.stat().st_ino
            if now != self._seen:
                self._seen = now
                self._send(theirs=True)


def _is_finished(path: Path, key: str) -> bool:
    """Whether the process that was waited for has finished the store."""
    try:
        _native.GreenCore.load(path, key)
    except (Error, OSError):
        return False
    return True


def main() -> None:
    """Compute what standard input asks for."""
    arguments = pickle.load(sys.stdin.buffer)
    painted, sent = _NextNodes(sys.stdin.buffer), None

    def send(**message: Any) -> None:
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()

    def progress(done: int, columns: int) -> None:
        nonlocal sent
        if sent != (done, columns):
            sent = (done, columns)
            send(done=done, columns=columns)

    growth = (arguments.pop("first"), painted.take, lambda nodes: send(ready=nodes))
    key, path = arguments.pop("key"), arguments["path"]
    try:
        with claimed(path, _StoreWatch(path, send)) as claim:
            if not _is_finished(path, key):
                _native.GreenCore.precompute_to(**arguments, progress=progress, growth=growth, claim=claim)
        send(finished=True)
    except Error as error:
        send(error=str(error))
    except OSError as error:
        send(error=f"{arguments['path']}: {error.strerror or error}")
    # The reading thread holds the lock of standard input, with which the interpreter cannot end.
    os._exit(0)


if __name__ == "__main__":
    main()
