"""Tasks of a cluster's worker: it factorises once, and solves blocks of columns."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate import _native
from palpate.cluster import require_version
from palpate.errors import ClusterError
from palpate.green.bounds import CHOSEN
from palpate.green.memory import allowed_memory

# A factor that nobody has asked for a block for so long is let go, s: its computation has gone elsewhere, or died.
IDLE = 60.0

Arrays = tuple[np.ndarray, ...]


@dataclass(frozen=True)
class FactorRequest:
    """What a worker is to factorise, beside the arrays of the problem.

    Attributes
    ----------
    key
        Of the operator.
    version
        Of Palpate, where the computation was started.
    precision
        Number format asked for; None: chosen by the body.
    memory
        Peak memory of a worker's process, such as ``"8GB"``; None: any.

    """

    key: str
    version: str
    precision: str | None
    memory: int | str | None


@dataclass
class _Factors:
    """Factored problems of this process, by key."""

    held: dict[str, _native.ColumnJob] = field(default_factory=dict)
    _timers: dict[str, threading.Timer] = field(default_factory=dict)
    _making: dict[str, threading.Lock] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def get(self, job: FactorRequest, problem: Arrays) -> _native.ColumnJob:
        """Factor of a job, made if need be; several tasks wait for one of them to make it."""
        with self._lock:
            making = self._making.setdefault(job.key, threading.Lock())
        with making:
            factor = self.held.get(job.key)
            if factor is None:
                memory = None if job.memory is None else allowed_memory(job.memory)
                factor = _native.ColumnJob(problem, job.precision, CHOSEN, threads(), memory)
                with self._lock:
                    # Not one that was let go while it was made.
                    if self._making.get(job.key) is making:
                        self.held[job.key] = factor
        self._restart_idle_timer(job.key)
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

    Raises
    ------
    ClusterError
        This machine orders rows and columns otherwise: its blocks are of other columns.

    """
    factor = _factorize(problem, job)
    if factor.order != order:
        raise ClusterError(
            f"the worker at {_address()} orders the columns differently: install the same build of Palpate there"
        )
    return factor.solve(block, width)


def release(key: str) -> None:
    """Let the factor of a job go."""
    _factors.release(key)


def _factorize(problem: Arrays, job: FactorRequest) -> _native.ColumnJob:
    require_version(job.version, _address())
    return _factors.get(job, problem)


def _address() -> str:
    from distributed import get_worker

    return str(get_worker().address)
