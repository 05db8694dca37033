"""Child process that computes a series beside a running force loop: ``python -m palpate.green.series_child``.

It is given the job as a pickle on its standard input, then a line of JSON with a point, m, whenever a tool has moved:
places near the point come first. It writes a line of JSON on its standard output for whatever has happened. Where its
input ends the program that started it is gone: it ends at once, and what is finished stays in the file.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import sys
import threading
from typing import Any, BinaryIO

from palpate import _native
from palpate.errors import Error
from palpate.green.claim import claimed


def _follow(stream: BinaryIO, file: _native.SeriesFile) -> None:
    for line in stream:
        file.set_near(tuple(json.loads(line)))
    # Not sys.exit: threads of the computation would be waited for.
    os._exit(0)


def _yield_processor(nice: int, cpus: list[int]) -> None:
    with contextlib.suppress(OSError, AttributeError):
        os.nice(nice)
        os.sched_setaffinity(0, cpus)


def main() -> None:
    """Compute what standard input asks for."""
    given = pickle.load(sys.stdin.buffer)
    _yield_processor(given["nice"], given["cpus"])
    file = _native.SeriesFile(given["laws"], given["radius"], given["store"], given["key"])
    threading.Thread(target=_follow, args=(sys.stdin.buffer, file), daemon=True).start()
    sent = None

    def send(**message: Any) -> None:
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()

    def progress(done: int, places: int) -> None:
        nonlocal sent
        if places and sent != (done, places):
            sent = (done, places)
            send(done=done, places=places)

    try:
        with claimed(file.path, lambda: None):
            file.compute(given["problem"], progress)
        send(finished=True)
    except Error as error:
        send(error=str(error))
    except OSError as error:
        send(error=f"{given['store']}: {error.strerror or error}")
    # The reading thread holds the lock of standard input, with which the interpreter cannot end.
    os._exit(0)


if __name__ == "__main__":
    main()
