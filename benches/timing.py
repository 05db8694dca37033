"""Times of work that is called again and again, us."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def call_times(work: Callable[[], object], repeats: int) -> np.ndarray:
    """Return the time of each of some calls, (repeats,) us."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1e6 * np.array(times)
