"""Plan of a precomputation: its size, memory and time, before any number is computed."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from palpate import _native, units
from palpate.body import Body, SurfaceRegion
from palpate.errors import BodyError
from palpate.green.job import Job
from palpate.green.resources import DiskUse, free_bytes, memory_in_use
from palpate.green.series import SeriesJob
from palpate.units import brief_repr

if TYPE_CHECKING:
    from distributed import Client

# Operations of factor and columns a second, over those of a product of matrices: of a million tetrahedra on two cores.
FACTOR_EFFICIENCY, COLUMN_EFFICIENCY = 0.7, 0.9
# Operations of a product of matrices that take as long as one of a sweep with eight columns, and as the sum of a series
# at a point of quadrature: of the built-in bodies and the examples.
SWEEP_COST, POINT_COST = 4.0, 2.2e4
# Time over which the product is repeated, s.
CALIBRATION = 0.1


@dataclass(frozen=True)
class SeriesPlan:
    """Counts of the series of a hyperelastic body below spheres of a radius."""

    radius: float  # m
    # All places, and those that are not stored yet.
    places: int
    missing: int
    size: int  # bytes of the file
    seconds: float  # estimate of the time that the missing ones take on this machine, s

    def __str__(self) -> str:
        """One line for people."""
        time_text = f"time about {_time_text(self.seconds)}, estimated" if self.missing else "stored"
        return (
            f"series beyond small strain below spheres of {1e3 * self.radius:g} mm: {self.places} places, "
            f"{self.size / 1e6:.2g} MB, {time_text}"
        )


@dataclass(frozen=True)
class Plan:
    """Counts of a precomputation.

    Attributes
    ----------
    precision
        Stored number format it is counted for. One that the body chooses is known only when columns have been measured:
        the counts are then those of the best that the memory allows, the most that will be needed.
    free_dofs, columns, rows
        Order of the matrix, and shape of the operator.
    factor_entries, factor_flops
        Numbers in the Cholesky factor, and operations to compute it.
    sweep_flops
        Operations to compute the columns by sweeps through the elimination tree, the route taken.
    surface_last_flops
        Least number of operations of the other route: all touchable dofs ordered last, their dense block inverted.
    block, tasks
        Columns solved together, and blocks solved at a time.
    memory
        Peak memory of the process, bytes: what it held when the plan was made, and what the precomputation adds.
    store
        Size of the operator in its file, bytes.
    disk
        Most that its files take at once, bytes: the store, what is finished beside it, the store of the stage before.
    disk_free
        Bytes free where they go, by now.
    seconds
        Estimate of the time it takes on this machine, s, by its operations and the speed of short products of
        matrices; other work on the machine makes it longer.
    series
        Of the series below spheres of the radii that were asked for; empty for a linear body and one with loads. They
        are computed after the Green's function, beside the running loop or before it.

    """

    precision: str
    free_dofs: int
    columns: int
    rows: int
    factor_entries: int
    factor_flops: float
    sweep_flops: float
    surface_last_flops: float
    block: int
    tasks: int
    memory: int
    store: int
    disk: int
    disk_free: int
    seconds: float
    series: tuple[SeriesPlan, ...] = ()

    def __str__(self) -> str:
        """Three lines for people, and one for each series."""
        factor, sweeps, other = (
            f"{n / 1e9:.3g}" for n in (self.factor_flops, self.sweep_flops, self.surface_last_flops)
        )
        lines = (
            f"{self.columns} columns of {self.rows} rows: {factor} Gflop for the factor, {sweeps} Gflop for the "
            f"columns (with the surface ordered last at least {other} Gflop)\n"
            f"peak memory {self.memory / 1e9:.2f} GB, {self.tasks} tasks with {self.block} columns each, "
            f"store {self.store / 1e9:.3g} GB in {self.precision}\n"
            f"disk {self.disk / 1e9:.3g} GB at most of {self.disk_free / 1e9:.3g} GB free, "
            f"time about {_time_text(self.seconds)}, estimated"
        )
        return "\n".join([lines, *map(str, self.series)])


def plan(
    body: Body,
    *,
    precision: str | None = None,
    touch: SurfaceRegion | None = None,
    first: SurfaceRegion | None = None,
    path: str | os.PathLike[str] | None = None,
    memory: int | str | None = None,
    dask: str | Client | None = None,
    radii: Sequence[float | str] = (),
) -> Plan:
    """Count what :func:`palpate.precompute` would do with the same arguments.

    With ``radii`` of spheres, m or text such as ``"5mm"``, the series of a hyperelastic body below them are counted
    too.

    With ``dask`` the memory is that of a worker with as many threads as this process has, and may be more than this
    machine has. No connection is made.

    Raises
    ------
    BodyError
        A bound of memory that is too small, radii that are not positive, or a body that :func:`palpate.precompute`
        refuses.
    StoreError
        Files that have no room on the disk.

    """
    job = Job.of(body, precision, touch, first, path)
    spheres = _radii(radii)
    used = memory_in_use()
    allowed = job.allowed(memory)
    if dask is not None and memory is None:
        allowed = None
    counts = _native.GreenCore.plan(job.problem, precision, allowed)
    disk = DiskUse.of(counts["columns"], counts["rows"], counts["precision"], 0 < len(job.first) < len(job.region))
    # The factor is always computed in double precision, columns of sixteen bits in single.
    double = _product_rate(single=False)
    rate = _product_rate(single=True) if counts["precision"] == "f16" else double
    factor, columns = FACTOR_EFFICIENCY * double, COLUMN_EFFICIENCY * rate
    seconds = counts["factor_flops"] / factor + counts["sweep_flops"] / columns
    rates = (factor, double)
    series = tuple(_plan_series(series, counts, rates) for series in SeriesJob.of_store(job, spheres))
    added = {"series": series, "disk": disk.peak, "disk_free": free_bytes(job.target), "seconds": seconds}
    return Plan(**{**counts, "memory": used + counts["memory"]}, **added)


def _radii(radii: Sequence[float | str]) -> list[float]:
    """Take radii of spheres, m or text; BodyError for radii that are not positive."""
    if isinstance(radii, str) or not isinstance(radii, Iterable):
        raise BodyError(f"radii must be a list of positive lengths, got {brief_repr(radii)}")
    found = [units.length(radius) for radius in radii]
    if not all(0 < radius < math.inf for radius in found):
        raise BodyError(f"radii must be a list of positive lengths, got {brief_repr(radii)}")
    return found


def _plan_series(job: SeriesJob, counts: dict[str, Any], rates: tuple[float, float]) -> SeriesPlan:
    """Count a series, by operations a second of the factor and of products."""
    places, missing, points, size = job.file().count(job.problem)
    # Three orders are solved, each by two sweeps of two operations an entry.
    of_place = 3 * 4 * SWEEP_COST * counts["factor_entries"] + POINT_COST * points
    seconds = counts["factor_flops"] / rates[0] + missing * of_place / rates[1] if missing else 0.0
    return SeriesPlan(job.radius, places, missing, size, seconds)


def _product_rate(single: bool) -> float:
    """Operations a second of a product of matrices on all threads."""
    best, until = 0.0, time.perf_counter() + CALIBRATION
    # The quickest of several: what else runs on the machine only makes some of them longer.
    while time.perf_counter() < until:
        begun = time.perf_counter()
        operations = _native.products(single, 8)
        best = max(best, operations / (time.perf_counter() - begun))
    return best


def _time_text(seconds: float) -> str:
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
