"""Child process that computes a series beside a running force loop: ``python -m palpate.green.series_child``.

After the job it is given a point, m, whenever a tool has moved: places near the point come first.
"""

from __future__ import annotations

import contextlib
import os
import threading

from palpate import _native
from palpate.green.child_process import compute_and_exit, progress_sender, received_job, received_lines
from palpate.green.claim import claimed


def _follow(file: _native.SeriesFile) -> None:
    for point in received_lines():
        file.set_near(tuple(point))


def _yield_processor(nice: int, cpus: list[int]) -> None:
    with contextlib.suppress(OSError, AttributeError):
        os.nice(nice)
        os.sched_setaffinity(0, cpus)


def main() -> None:
    """Compute what standard input asks for."""
    given = received_job()
    _yield_processor(given["nice"], given["cpus"])
    file = _native.SeriesFile(given["laws"], given["radius"], given["store"], given["key"])
    threading.Thread(target=_follow, args=(file,), daemon=True).start()

    def compute() -> None:
        with claimed(file.path, lambda: None):
            file.compute(given["problem"], progress_sender("places"))

    compute_and_exit(compute, given["store"])


if __name__ == "__main__":
    main()
