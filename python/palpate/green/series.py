"""Taylor series of a hyperelastic body's displacement, stored beside its Green's function."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate import _native
from palpate.body import Body, problem_arrays
from palpate.body.material import element_laws
from palpate.cluster import connected
from palpate.errors import StoreError
from palpate.green.function import GreensFunction
from palpate.green.gathering import series_on
from palpate.green.job import Job, claimed
from palpate.green.worker import SeriesRequest

if TYPE_CHECKING:
    from distributed import Client


@dataclass(frozen=True)
class SeriesJob:
    """The series of a body for spheres of one radius: what it is of, and its file."""

    body: Body  # what it is of
    radius: float  # m
    touchable: np.ndarray  # surface nodes at which it is known, ascending
    # File and key of the body's Green's function.
    store: Path
    key: str

    @classmethod
    def of(cls, green: GreensFunction, body: Body, radius: float) -> SeriesJob | None:
        """Return the job of a body; None for a linear one, one with loads and one whose store has no file."""
        if green.path is None or not _has_series(body):
            return None
        return cls(body, radius, green.touchable_nodes, green.path, green.key)

    @classmethod
    def of_store(cls, job: Job, radii: Sequence[float]) -> list[SeriesJob]:
        """Return the jobs below spheres of some radii, m, of a body whose store may be still to come."""
        if not _has_series(job.body):
            return []
        return [cls(job.body, radius, job.region, job.target, job.key) for radius in radii]

    @property
    def laws(self) -> tuple[list[tuple[str, float, float]], np.ndarray]:
        """Laws and the law of each element, as the native module takes them."""
        return element_laws(self.body.mesh, self.body.material)

    @property
    def problem(self) -> tuple[np.ndarray, ...]:
        """The problem as the native module takes it."""
        return problem_arrays(self.body, self.touchable)

    def file(self) -> _native.SeriesFile:
        """Return the file."""
        return _native.SeriesFile(self.laws, self.radius, self.store, self.key)

    def compute(
        self, progress: Callable[[int, int], None] | None = None, dask: str | Client | None = None
    ) -> _native.Series:
        """Read the series from its file, and compute and store what is missing there.

        One process at a time computes it, the others wait. With ``dask`` the workers of a cluster compute, as in
        :func:`palpate.precompute`. Raises BodyError for a body that is not held; ClusterError for a cluster that cannot
        be reached, has no workers or other versions, or fails.
        """
        file = self.file()

        def wait() -> None:
            stored = file.load()
            if progress is not None and stored is not None:
                progress(stored.done, stored.places)

        stored = file.load()
        if stored is not None and stored.is_complete:
            return stored
        try:
            with claimed(file.path, wait):
                return self._completed(file, progress, dask)
        except OSError:
            # No file can be written there: the result is the same.
            return self._completed(file, progress, dask)

    def _completed(
        self, file: _native.SeriesFile, progress: Callable[[int, int], None] | None, dask: str | Client | None
    ) -> _native.Series:
        if dask is None:
            return file.compute(self.problem, progress)
        with connected(dask) as client:
            request = SeriesRequest(file.path.name, _native.__version__, self.laws, self.radius)
            return series_on(client, self.problem, request, file, progress)


def _has_series(body: Body) -> bool:
    return body.loads is None and body.is_hyperelastic


def series_beside(store: Path) -> list[Path]:
    """Files of series that lie beside a store."""
    return sorted(store.parent.glob(f"{glob.escape(store.stem)}.*.series.palpate"))


def lines_of_series(store: Path) -> Iterator[str]:
    """Lines about the files of series beside a store, for people; one that cannot be read says why."""
    for path in series_beside(store):
        try:
            yield f"{path.name}: {series_line(path)}"
        except StoreError as error:
            yield str(error)


def series_line(path: Path) -> str:
    """One line about a file of series, for people; StoreError for a file that is damaged or of another version."""
    series = _native.Series.read(path)
    done = "all" if series.is_complete else f"{series.done:,} of"
    return f"series beyond small strain at {done} {series.places:,} places, {path.stat().st_size / 1e6:.2g} MB"
