"""Precomputation by the workers of a cluster: they solve blocks, this process writes the files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from palpate import _native
from palpate.cluster import require_scheduler, result_of, spread, submit, threads_of_workers, wait_for_some
from palpate.errors import ClusterError
from palpate.green import worker
from palpate.green.bounds import CHOSEN
from palpate.green.job import Job

if TYPE_CHECKING:
    from distributed import Client, Future

# A block that was damaged in transit is asked for again, so often.
MOST_DAMAGED = 3

Report = Callable[[int, int], None] | None


def precompute_on(
    client: Client, what: Job, claim: _native.StoreClaim, memory: int | str | None, report: Report
) -> bool:
    """Write the Green's function that is claimed; whether a partial file of something else was thrown away.

    Every worker factorises the problem once. Finished blocks stand in ``<store>.partial``, and are kept whatever
    happens to the cluster: the same call, here or without a cluster, goes on from them. Raises ClusterError for workers
    that fail, or a scheduler that is lost.
    """
    problem, precision = what.problem, what.precision
    job = worker.FactorRequest(what.key, _native.__version__, precision, memory)
    held = submit(client, worker.pass_through, problem)
    try:
        measuring = _measure(client, held, job)
        # Assembled and ordered here, too, while the workers factorise.
        layout = _native.ColumnLayout(problem)
        while (found := _first(client, measuring)) is None:
            measuring = measuring or _measure(client, held, job)
        measured, order = found
        # Nobody needs to measure again for a worker that dies.
        client.cancel(measuring)
        if order != layout.order:
            raise ClusterError("the workers order the columns differently: install the same build of Palpate there")
        store = _native.ColumnStore(layout, precision, CHOSEN, measured, what.target, what.description, claim)
        _, width, *_ = measured

        def solve(block: int, address: str) -> Future:
            return submit(client, worker.solve, held, job, order, block, width, address=address)

        _gather(client, store.missing(), solve, store.put, lambda: (store.done, store.columns), report)
        store.finish(report)
        return store.discarded
    finally:
        _release(client, job.key)


def _measure(client: Client, held: Future, job: worker.FactorRequest) -> list[Future]:
    """Have all workers factorise that are there."""
    return [submit(client, worker.measure, held, job, address=address) for address in threads_of_workers(client)]


def _first(client: Client, futures: list[Future]) -> tuple[tuple[Any, ...], bytes] | None:
    """Wait for the first task that ends, and give its result; None if none has for a while."""
    for future in wait_for_some(client, futures):
        return result_of(client, future)
    return None


def series_on(
    client: Client, problem: worker.Arrays, job: worker.SeriesRequest, file: _native.SeriesFile, report: Report
) -> _native.Series:
    """Complete a series. Finished blocks are kept in its file, whatever happens to the cluster.

    Raises ClusterError for workers that fail, or a scheduler that is lost.
    """
    gathered = file.gathering(problem)
    held = submit(client, worker.pass_through, problem)

    def solve(block: int, address: str) -> Future:
        return submit(client, worker.solve_series, held, job, gathered.order, block, address=address)

    try:
        _gather(client, gathered.missing(), solve, gathered.put, lambda: (gathered.done, gathered.places), report)
        return gathered.known()
    finally:
        _release(client, job.key)


def _gather(
    client: Client,
    missing: list[int],
    solve: Callable[[int, str], Future],
    put: Callable[..., bool],
    counts: Callable[[], tuple[int, int]],
    report: Report,
) -> None:
    """Have the missing blocks solved, and keep them."""

    def tell() -> None:
        if report is not None:
            report(*counts())

    tell()
    damaged: Counter[int] = Counter()
    waiting = missing[::-1]
    for block, future in spread(client, waiting, solve):
        if not put(block, *result_of(client, future)):
            damaged[block] += 1
            if damaged[block] == MOST_DAMAGED:
                raise ClusterError(f"block {block} was damaged in transit {MOST_DAMAGED} times")
            waiting.append(block)
        tell()


def _release(client: Client, key: str) -> None:
    """Have the workers let their factors go; those that do not hear it do so after a while."""
    try:
        require_scheduler(client)
        client.run(worker.release, key, on_error="ignore")
    except (ClusterError, OSError):
        return
