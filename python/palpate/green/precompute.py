"""Green's functions, loaded from their files or computed and stored."""

from __future__ import annotations

import contextlib
import itertools
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate import _native
from palpate.body import Body, SurfaceRegion, surface_region
from palpate.cluster import connected
from palpate.errors import ClusterError, PrecisionWarning, StoreError, StoreWarning, TouchWarning
from palpate.fields import STRAIN_LIMIT
from palpate.green.bounds import CHOSEN, WARNED, error_text, remedy
from palpate.green.function import GreensFunction
from palpate.green.gathering import precompute_on
from palpate.green.job import Job, claimed, waiting_message
from palpate.progress import progress_reporter

if TYPE_CHECKING:
    from distributed import Client


def precompute(
    body: Body,
    *,
    precision: str | None = None,
    touch: SurfaceRegion | None = None,
    first: SurfaceRegion | None = None,
    path: str | os.PathLike[str] | None = None,
    memory: int | str | None = None,
    progress: bool | Callable[[int, int], None] = True,
    ready: Callable[[GreensFunction], None] | None = None,
    painted: Callable[[], Sequence[int] | None] | None = None,
    dask: str | Client | None = None,
) -> GreensFunction:
    """Green's function of a body, from its file if that matches, else computed and written there.

    An interrupted computation leaves what it finished in ``<path>.partial``; the next call with the same arguments
    continues from there, with the same bits. One process writes a file at a time: a second one waits for the first,
    and then takes its file or continues it.

    Parameters
    ----------
    body
        A supported body, with its loads.
    precision
        Stored number format: ``"f16"``, ``"f32"`` or ``"f64"``, of 2, 4 and 8 bytes an entry. Answers are computed in
        double precision from the stored numbers. None: the cheapest in which typical contacts of this body are right
        to 0.03 %, as measured on some columns.
    touch
        Region of the surface that may be touched: surface nodes, a mask of all nodes, a predicate such as
        ``"z > 3cm"``, a region of the mesh file by name or number, or a solid of :mod:`palpate.shapes`; None: all.
    first
        Region that is computed first. The store is then written as soon as that is ready, complete and valid for the
        nodes that can be touched, and again as the others follow by their distance from it, in stages each of which is
        about as large as all before it. None: all at once.
    path
        File; None keeps it in the cache under its content key.
    memory
        Bytes that the process may take at its peak, or text such as ``"8GB"``; None: as many as are useful. The
        operator itself is written as it is computed, and takes none. With ``dask``: of each worker's process.
    progress
        True shows a bar on a terminal; a function is called with columns done and in all.
    ready
        Called with the Green's function of each stage but the last, while the next is computed.
    painted
        Asked some times a second for surface nodes that are to come next; None: as planned.
    dask
        Address of a scheduler of dask.distributed, such as ``"tcp://10.0.0.1:8786"``, or a client of it: its workers
        solve the columns, this process writes the store, of the same key and the same bits, all at once. Workers may
        join and die meanwhile. Needs ``palpate[cluster]``, of the same version everywhere.

    Raises
    ------
    BodyError
        A body that its supports leave free to move, a touch node that is not on the surface, or more memory than there
        is, or than is allowed.
    StoreError
        Files that have no room on the disk, with what would fit, or have none any more, with what is kept.
    ClusterError
        A cluster that cannot be reached, has no workers or other versions, or fails; or one that is to compute a region
        ``first``.

    Warns
    -----
    PrecisionWarning
        Touches may be wrong by more than 1 %.
    TouchWarning
        The body's own loads strain its surface by more than 30 %.
    StoreWarning
        Another process computes the same file, and is waited for; or it had left something that does not belong here.

    """
    if dask is not None and not (first is None and ready is None and painted is None):
        raise ClusterError("a cluster computes all columns at once: leave out first, ready and painted")
    job = Job.of(body, precision, touch, first, path)
    stored = job.stored()
    if stored is not None:
        return _with_warnings(stored)
    with _reporting_disk_failures(job.target), claimed(job.target, _warn_once_of_waiting(job.target)) as claim:
        # Whoever had the claim before may have finished it.
        stored = job.stored()
        if stored is not None:
            return _with_warnings(stored)
        job.make_room()
        if dask is None:
            discarded = _in_this_process(job, claim, memory, progress, first is not None, ready, painted)
        else:
            # Of memory the workers see to their own; the files have to have room here.
            job.allowed(None)
            # A lost connection, an OSError of the library, is told apart in here.
            with connected(dask) as client, progress_reporter("precomputing", progress) as report:
                discarded = precompute_on(client, job, claim, memory, report)
    if discarded:
        warnings.warn(
            f"{job.target}.partial belongs to another computation and was deleted", StoreWarning, stacklevel=2
        )
    green = job.load()
    job.make_room(written=True)
    return _with_warnings(green)


def _warn_once_of_waiting(target: Path) -> Callable[[], None]:
    """Return a function that warns once that another process is computing the store."""
    calls = itertools.count()

    def waiting() -> None:
        if next(calls) == 0:
            warnings.warn(waiting_message(target), StoreWarning, stacklevel=5)

    return waiting


def _in_this_process(
    job: Job,
    claim: _native.StoreClaim,
    memory: int | str | None,
    progress: bool | Callable[[int, int], None],
    staged: bool,
    ready: Callable[[GreensFunction], None] | None,
    painted: Callable[[], Sequence[int] | None] | None,
) -> bool:
    """Compute in this process; whether a partial file of something else was thrown away."""
    allowed = job.allowed(memory)
    growth = (job.first, *_watchers(job, ready, painted)) if staged or painted is not None else None
    with progress_reporter("precomputing", progress) as report:
        _, discarded = _native.GreenCore.precompute_to(
            job.problem,
            job.precision,
            CHOSEN,
            job.description,
            report,
            job.target,
            allowed,
            growth,
            report and report.phase,
            claim,
        )
    return discarded


@contextlib.contextmanager
def _reporting_disk_failures(target: Path) -> Iterator[None]:
    """Say where a full disk, or another failure of it, has left finished columns."""
    try:
        yield
    except OSError as error:
        partial = Path(f"{target}.partial")
        if not partial.exists():
            raise
        raise StoreError(
            f"{error.filename or target}: {error.strerror or error}; finished columns are kept in {partial}: "
            "free some disk space, and the same command continues from there"
        ) from error


def _watchers(
    job: Job, ready: Callable[[GreensFunction], None] | None, painted: Callable[[], Sequence[int] | None] | None
) -> tuple[Callable[[], list[int] | None], Callable[[int], None]]:
    """Make what the native module calls: for ranks of the next nodes, and with the store of a stage."""
    surface = job.body.mesh.surface_nodes

    def asked() -> list[int] | None:
        nodes = None if painted is None else painted()
        if nodes is None:
            return None
        return np.searchsorted(surface, surface_region(job.body, np.asarray(nodes), "painted")).tolist()

    def written(_nodes: int) -> None:
        if ready is not None:
            ready(job.load_growing())

    return asked, written


def _with_warnings(green: GreensFunction) -> GreensFunction:
    """Warn of a store in which touches may be wrong, and of loads that crush the body."""
    if not green.touch_error <= WARNED:
        text = f"touches of this body may be wrong by {error_text(green.touch_error)}"
        warnings.warn(f"{text}: {remedy(green.touch_error, green.precision)}", PrecisionWarning, stacklevel=3)
    strain = green.surface_strain.largest(green.free_displacements)
    if not strain <= STRAIN_LIMIT:
        text = f"the body's own loads strain its surface by {100 * strain:.0f} %, beyond {100 * STRAIN_LIMIT:.0f} %"
        warnings.warn(
            f"{text}: linear elasticity has no meaning there; check units, stiffness and supports",
            TouchWarning,
            stacklevel=3,
        )
    return green
