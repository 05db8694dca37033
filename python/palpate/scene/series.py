"""Series beyond small strain of the bodies of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from palpate.green.series import force_series
from palpate.progress import progress_reporter
from palpate.scene.build import BuiltBody, BuiltScene


def with_series(built: BuiltScene, progress: bool | Callable[[int, int], None] = False) -> BuiltScene:
    """Give hyperelastic bodies the series of their displacement below the spheres of a scene.

    They are read from files beside the stores, or computed. Without them contacts follow a half-space of the material,
    and the body below it stays linear. Bodies in motion and bodies with loads have none.

    Raises
    ------
    Error
        A body that is not held.

    """
    radii = sorted({float(t.radius) for t in built.scene.tools if t.contact == "local" and t.shape == "sphere"})
    return replace(built, bodies=tuple(_with_series(body, radii, progress) for body in built.bodies))


def _with_series(body: BuiltBody, radii: list[float], progress: bool | Callable[[int, int], None]) -> BuiltBody:
    if body.body is None or body.motion is not None:
        return body
    found = []
    for radius in radii:
        with progress_reporter("series beyond small strain", progress) as report:
            series = force_series(body.green, body.body, radius, report)
        if series is not None:
            found.append((radius, series[0]))
    return replace(body, series=tuple(found))
