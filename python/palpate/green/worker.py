"""Tasks of a cluster's worker: it factorises once, and solves blocks of columns, or of places of a series."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate import _native
from palpate.cluster import require_version
from palpate.errors import ClusterError
from palpate.green.bounds import CHOSEN
from palpate.green.resources import allowed_memory

# A factor that nobody has asked for a block for so long is let go, s: its computation has gone elsewhere, or died.
IDLE = 60.0

Arrays = tuple[np.ndarray, ...]


@dataclass(frozen=True)
class FactorRequest:
    """What a worker is to factorise, beside the arrays of the problem."""

    key: str  # of the operator
    version: str  # of Palpate, where the computation was started
    precision: str | None  # number format asked for; None: chosen by the body
    memory: int | str | None  # peak memory of a worker's process, such as ``"8GB"``; None: any


@dataclass(frozen=True)
class SeriesRequest:
    """What a worker is to factorise for a series, beside the arrays of the problem."""

    key: str  # of the series
    version: str  # of Palpate, where the computation was started
    laws: tuple[list[tuple[str, float, float]], np.ndarray]  # of the material, and that of each element
    radius: float  # of the tool, m


@dataclass
class _Factors:
    """Factored problems of this process, by key."""

    held: dict[str, Any] = field(default_factory=dict)
    _timers: dict[str, threading.Timer] = field(default_factory=dict)
    _making: dict[str, threading.Lock] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def get(self, key: str, factorize: Callable[[], Any]) -> Any:
        """Factor of a problem, made if need be; several tasks wait for one of them to make it."""
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        with making:
            factor = self.held.get(key)
            if factor is None:
                factor = factorize()
                with self._lock:
                    # Not one that was let go while it was made.
                    if self._making.get(key) is making:
                        self.held[key] = factor
        self._restart_idle_timer(key)
        return factor

    def release(self, key: str) -> None:
        """Let a factor go; tasks that are under way keep it until they are done."""
        with self._lock:
            timer = self._timers.pop(key, None)
            self._making.pop(key, None)
            self.held.pop(key, None)
        if timer is not None:
            timer.cancel()

    def _restart_idle_timer(self, key: str) -> None:
        """Begin to count the idle time again."""
        timer = threading.Timer(IDLE, self.release, [key])
        timer.daemon = True
        with self._lock:
            if key not in self.held:
                return
            before = self._timers.pop(key, None)
            self._timers[key] = timer
        if before is not None:
            before.cancel()
        timer.start()


_factors = _Factors()


def threads() -> int:
    """Threads that the worker may use for its tasks."""
    from distributed import get_worker

    return int(get_worker().state.nthreads)


def pass_through(problem: Arrays) -> Arrays:
    """Return the arrays as they came: as a task, what it returns is held by workers, and made again where they die."""
    return problem


def measure(problem: Arrays, job: FactorRequest) -> tuple[tuple[Any, ...], bytes]:
    """Factorise; what the store needs to know of that, and the hash of the order of rows and columns."""
    factor = _factorize(problem, job)
    return factor.measured, factor.order


def solve(problem: Arrays, job: FactorRequest, order: bytes, block: int, width: int) -> tuple[bytes, bytes]:
    """Panel of a block of ``width`` columns, and its checksum.

    Raises ClusterError if this machine orders rows and columns otherwise: its blocks are of other columns.
    """
    factor = _factorize(problem, job)
    _require_order(factor.order, order, "columns")
    return factor.solve(block, width)


def solve_series(problem: Arrays, job: SeriesRequest, order: bytes, block: int) -> tuple[bytes, bytes]:
    """Coefficients of a series at a block of places, and their checksum.

    Raises ClusterError if this machine orders the places otherwise.
    """
    require_version(job.version, _address())
    factor = _factors.get(job.key, lambda: _native.SeriesBlocks(problem, job.laws, job.radius, threads()))
    _require_order(factor.order, order, "places of the series")
    return factor.solve(block)


def release(key: str) -> None:
    """Let the factor of a job go."""
    _factors.release(key)


def _factorize(problem: Arrays, job: FactorRequest) -> _native.ColumnJob:
    require_version(job.version, _address())

    def factorize() -> _native.ColumnJob:
        memory = None if job.memory is None else allowed_memory(job.memory)
        return _native.ColumnJob(problem, job.precision, CHOSEN, threads(), memory)

    return _factors.get(job.key, factorize)


def _require_order(found: bytes, order: bytes, what: str) -> None:
    if found != order:
        raise ClusterError(
            f"the worker at {_address()} orders the {what} differently: install the same build of Palpate there"
        )


def _address() -> str:
    from distributed import get_worker

    return str(get_worker().address)
