"""Series beyond small strain of the bodies of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from palpate import _native
from palpate.green.series import SeriesJob
from palpate.progress import progress_reporter
from palpate.scene.build import BuiltBody, BuiltScene

if TYPE_CHECKING:
    from distributed import Client

TITLE = "series beyond small strain"


def series_jobs(body: BuiltBody, radii: list[float]) -> list[SeriesJob]:
    """Series of a body below spheres of some radii, m; none of a body that moves, or has no series."""
    if body.body is None or body.motion is not None:
        return []
    jobs = [SeriesJob.of(body.green, body.body, radius) for radius in radii]
    return [job for job in jobs if job is not None]


def sphere_radii(built: BuiltScene) -> list[float]:
    """Radii, m, of the spheres of a scene that press under the local law."""
    return sorted({float(t.radius) for t in built.scene.tools if t.contact == "local" and t.shape == "sphere"})


def with_series(
    built: BuiltScene, progress: bool | Callable[[int, int], None] = False, dask: str | Client | None = None
) -> BuiltScene:
    """Give hyperelastic bodies the series of their displacement below the spheres of a scene.

    They are read from files beside the stores, or computed, with ``dask`` by the workers of a cluster. Without them
    contacts follow a half-space of the material, and the body below it stays linear. Bodies in motion and bodies with
    loads have none. Raises Error for a body that is not held.
    """
    radii = sphere_radii(built)
    return _with(built, lambda _: radii, lambda job: _computed(job, progress, dask))


def with_whole_series(built: BuiltScene, progress: bool | Callable[[int, int], None] = False) -> BuiltScene:
    """Complete the series of bodies that have series, as of :func:`with_series`."""
    return _with(built, lambda body: [radius for radius, _ in body.series], lambda job: _computed(job, progress))


def with_stored_series(built: BuiltScene) -> BuiltScene:
    """Give hyperelastic bodies what is stored of their series: a simulation computes the rest beside its loop."""
    radii = sphere_radii(built)
    return _with(built, lambda _: radii, stored_series)


def with_series_of_tools(built: BuiltScene) -> BuiltScene:
    """Give bodies what is stored of the series for tools that have come; what they have of the others stays."""
    radii = sphere_radii(built)

    def of_body(body: BuiltBody) -> BuiltBody:
        known = dict(body.series)
        new = [radius for radius in radii if radius not in known]
        return replace(body, series=body.series + _found(body, new, stored_series))

    return replace(built, bodies=tuple(map(of_body, built.bodies)))


def stored_series(job: SeriesJob) -> _native.Series | None:
    """Return what is stored of a series."""
    return job.file().load()


def _computed(
    job: SeriesJob, progress: bool | Callable[[int, int], None], dask: str | Client | None = None
) -> _native.Series:
    with progress_reporter(TITLE, progress) as report:
        return job.compute(report, dask)


def _with(
    built: BuiltScene, radii: Callable[[BuiltBody], list[float]], find: Callable[[SeriesJob], _native.Series | None]
) -> BuiltScene:
    def of_body(body: BuiltBody) -> BuiltBody:
        return replace(body, series=_found(body, radii(body), find))

    return replace(built, bodies=tuple(map(of_body, built.bodies)))


def _found(
    body: BuiltBody, radii: list[float], find: Callable[[SeriesJob], _native.Series | None]
) -> tuple[tuple[float, _native.Series | None], ...]:
    """Radii, m, and what is found of their series; nothing while the body's Green's function grows."""
    return tuple((job.radius, None if body.is_growing else find(job)) for job in series_jobs(body, radii))
