"""A Dask cluster of processes on this machine."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator

import distributed


@contextlib.contextmanager
def local_cluster(workers: int) -> Iterator[distributed.LocalCluster]:
    """Scheduler in this process, and workers of one thread each."""
    # Workers that are killed on purpose are not worth the library's warnings.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    before = os.environ.get("RAYON_NUM_THREADS")
    with distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0", silence_logs=logging.CRITICAL
    ) as cluster:
        yield cluster
    assert os.environ.get("RAYON_NUM_THREADS") == before
