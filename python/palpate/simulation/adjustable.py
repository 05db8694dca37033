"""Settings of a simulation that may be changed while its loop runs, and its series, which are computed beside the loop.

Settings are numbers in SI, or text with a unit. Scripts wait for the series.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

import numpy as np

from palpate import _native, units
from palpate.errors import SceneError
from palpate.green.background_series import BackgroundSeries
from palpate.green.series import SeriesJob
from palpate.progress import progress_reporter
from palpate.scene import MOST_FRICTION, BuiltBody
from palpate.scene.series import TITLE, series_jobs
from palpate.scene.tables import SceneTables
from palpate.simulation.about import series_text
from palpate.simulation.script import strike_of
from palpate.vectors import number

Check = tuple[Callable[[Any], float], Callable[[float], bool], str]


def _plain(what: str) -> Callable[[Any], float]:
    return lambda value: number(value, what, SceneError)


# By name: how a value is read, whether it is within its range, and what is said of one that is not.
_CHECKS: dict[str, Check] = {
    "contact_radius": (units.length, lambda x: x >= 0, "the contact radius must not be negative, got {:g} m"),
    "youngs_modulus": (units.pressure, lambda x: x > 0, "Young's modulus must be positive, got {:g} Pa"),
    "friction": (
        _plain("friction"),
        lambda x: 0 <= x <= MOST_FRICTION,
        f"friction must lie between 0 and {MOST_FRICTION:g}, got {{:g}}",
    ),
    "strain_limit": (
        _plain("the limit of strain"),
        lambda x: 0 <= x <= 1,
        "the limit of strain must lie in [0, 1], got {:g}",
    ),
    "time_scale": (_plain("the time scale"), lambda x: 0 < x <= 1, "the time scale must lie in (0, 1], got {:g}"),
}


def checked(name: str, value: Any) -> float:
    """Value of a setting; of one without a range of its own any finite number.

    Raises SceneError for a value that is no number, or out of its range.
    """
    read, holds, refused = _CHECKS.get(name, (_plain(name), lambda x: True, ""))
    checked = read(value)
    if not (np.isfinite(checked) and holds(checked)):
        raise SceneError(refused.format(checked))
    return checked


class Adjustable:
    """Settings of a simulation, which the native part of it has."""

    scene: SceneTables
    bodies: tuple[BuiltBody, ...]
    _core: _native.SimulationCore
    # Whether the native part has measures of the strain of all bodies.
    _armed: bool
    # Whether strain is measured by the surfaces of all bodies, as a page without a server does.
    _by_surface: bool = False

    def _settings(self) -> dict[str, Any]:
        return self._core.settings()

    def set_radius(self, contact_radius: float | str, tool: int | None = None) -> None:
        """Contact radius of contacts that begin from now on, m, of one tool or of all.

        Raises
        ------
        Error
            A radius under which a contact would cover more nodes than a tick can weigh.

        """
        self._set_of_tools("contact_radius", contact_radius, tool)

    def set_friction(self, friction: float, tool: int | None = None) -> None:
        """Coulomb's coefficient of friction from now on, of one tool or of all; 0 slides freely.

        Raises
        ------
        SceneError
            A coefficient that is negative, or greater than 10.

        """
        self._set_of_tools("friction", friction, tool)

    def friction_of(self, tool: int = 0) -> float:
        """Coulomb's coefficient of friction of a tool."""
        return self._settings()["friction"][self._tool(tool)]

    def contact_radius_of(self, tool: int = 0) -> float:
        """Contact radius of contacts of a tool that begin from now on, m."""
        return self._settings()["contact_radius"][self._tool(tool)]

    @property
    def contact_radius(self) -> float:
        """Contact radius of contacts of the first tool that begin from now on, m."""
        return self.contact_radius_of()

    def largest_contact_radius(self, limit: float) -> float:
        """Largest contact radius up to ``limit`` (m) that can be weighed everywhere, to about a hundredth."""
        return min(body.green.largest_contact_radius(limit) for body in self.bodies)

    def youngs_modulus_of(self, body: int = 0) -> float | None:
        """Young's modulus of a body now, Pa; None for one of several materials, with loads, or in motion."""
        reference = self.bodies[self._body(body)].green.youngs_modulus
        fixed = reference is None or self.bodies[body].motion is not None
        return None if fixed else reference * self.stiffness_scale_of(body)

    @property
    def youngs_modulus(self) -> float | None:
        """Young's modulus of the first body now, Pa, as of :meth:`youngs_modulus_of`."""
        return self.youngs_modulus_of()

    def stiffness_scale_of(self, body: int = 0) -> float:
        """Young's modulus of a body now over that of its Green's function."""
        return self._settings()["stiffness_scale"][self._body(body)]

    @property
    def stiffness_scale(self) -> float:
        """Young's modulus of the first body now over that of its Green's function."""
        return self.stiffness_scale_of()

    def set_youngs_modulus(self, youngs_modulus: float | str, body: int = 0) -> None:
        """Change the stiffness of a body of one material at rest, without loads, Pa: it only scales the compliance.

        Raises
        ------
        SceneError
            A body whose stiffness is part of what was computed, or a modulus that is not positive.

        """
        reference = self.bodies[self._body(body)].green.youngs_modulus
        if reference is None or self.bodies[body].motion is not None:
            raise SceneError(
                "the body has several materials, or loads, or moves: its stiffness cannot be changed while running"
            )
        self._core.set("stiffness_scale", body, checked("youngs_modulus", youngs_modulus) / reference)

    @property
    def strain_limit(self) -> float:
        """Largest strain to which tools may take the bodies now; 0 for any."""
        return self._settings()["strain_limit"]

    def set_strain_limit(self, strain_limit: float) -> None:
        """Largest strain to which tools may take the bodies from now on; 0 takes the limit away.

        Raises
        ------
        SceneError
            A limit below 0 or above 1.

        """
        limit = checked("strain_limit", strain_limit)
        self._arm_strain_limit(limit)
        self._core.set("strain_limit", 0, limit)

    def _arm_strain_limit(self, limit: float | None = None) -> None:
        """Give the loop what measures strain, once it is asked to limit it: it takes a factor of every body."""
        asked = self._core.settings()["strain_limit"] if limit is None else limit
        if asked > 0 and not self._armed:
            _native.set_strain_measures(self._core, [self._strain_measure_of(body) for body in self.bodies])
            self._armed = True

    def _strain_measure_of(self, body: BuiltBody) -> _native.StrainMeasure:
        """Return what measures the strain of a body; a page without a server knows the surface alone."""
        green = body.green
        return _native.StrainMeasure.of_surface(green._core) if self._by_surface else green.native_strain_measure

    def strike(
        self, point: Sequence[float], impulse: Sequence[float], duration: float = 0.0, body: int | None = None
    ) -> None:
        """Strike a body in motion: an impulse (3,), N s, on the patch around the surface point closest to ``point``, m.

        The patch has the contact radius of the first tool. The force is half a wave of ``duration``, s; it takes one
        time step at least and a thousand at most. ``body`` is the first that moves unless it is given.

        Raises
        ------
        SceneError
            A body that does not move, or numbers that are not finite.

        """
        struck = self._moving_body("strike", body)
        self._core.strike(struck, *strike_of(point, impulse, duration))

    def set_time_scale(self, time_scale: float) -> None:
        """Seconds that bodies in motion advance in a second, in (0, 1]: below one is slow motion.

        Raises
        ------
        SceneError
            No body moves, or a scale outside of (0, 1].

        """
        self._moving_body("slow motion", None)
        self._core.set("time_scale", 0, checked("time_scale", time_scale))

    @property
    def time_scale(self) -> float:
        """Seconds that bodies in motion advance in a second."""
        return self._settings()["time_scale"]

    def watch(self, node: int, body: int = 0) -> None:
        """Log the displacement of a surface node (mesh index) from now on; at first it is the lowest one's.

        Raises
        ------
        SceneError
            A node that is not on the surface.

        """
        self._core.watch(self._body(body), self._rank_of(node, body))

    def _rank_of(self, node: int, body: int) -> int:
        surface = self.bodies[body].green.surface_nodes
        rank = int(np.searchsorted(surface, node))
        if rank == len(surface) or surface[rank] != node:
            raise SceneError(f"node {node} is not on the surface: it cannot be watched")
        return rank

    def _moving_body(self, what: str, body: int | None) -> int:
        moving = [rank for rank, one in enumerate(self.bodies) if one.motion is not None]
        chosen = next(iter(moving), None) if body is None else self._body(body)
        if chosen not in moving:
            raise SceneError(f"{what}: the body does not move; give the scene a [dynamics] table")
        return chosen

    def _set_of_tools(self, name: str, value: float | str, tool: int | None) -> None:
        number = checked(name, value)
        for changed in range(len(self.scene.tools)) if tool is None else [self._tool(tool)]:
            self._core.set(name, changed, number)

    def _tool(self, tool: int) -> int:
        if not (isinstance(tool, Integral) and 0 <= tool < len(self.scene.tools)):
            raise SceneError(f"there is no tool {tool!r}: the scene has {len(self.scene.tools)}")
        return tool

    def _body(self, body: int) -> int:
        if not (isinstance(body, Integral) and 0 <= body < len(self.bodies)):
            raise SceneError(f"there is no body {body!r}: the scene has {len(self.bodies)}")
        return body


class SeriesGrowth(Adjustable):
    """The series of the bodies of a simulation, where their scene has series."""

    _running: bool
    _editing: threading.RLock
    _background: BackgroundSeries | None = None

    @property
    def series(self) -> BackgroundSeries | None:
        """What is computed of the series beyond small strain beside the loop; None while nothing is."""
        return self._background

    def _missing_series(self) -> list[SeriesJob]:
        """Series that are not known at all places yet, of bodies whose Green's function is complete."""
        missing = []
        for body in self.bodies:
            radii = [radius for radius, known in body.series if known is None or not known.is_complete]
            if not body.is_growing:
                missing += series_jobs(body, radii)
        return missing

    def complete_series(self, progress: bool | Callable[[int, int], None] = True) -> None:
        """Compute the series of all bodies at all places, or wait until another process has: scripts do.

        Raises
        ------
        Error
            A body that is not held.

        """
        for job in self._missing_series():
            with progress_reporter(TITLE, progress) as report:
                self._take_series(job, job.compute(report))

    def _prepare_script(self) -> None:
        """Make ready what ticks of a script need: the same script has the same forces."""
        self._arm_strain_limit()
        self.complete_series()

    def _begin_series(self) -> None:
        """Compute what is missing beside the loop, near the tools first."""
        jobs = self._missing_series()
        if jobs:
            self._background = BackgroundSeries(jobs, self._take_series, self._pressed_place)

    def _continue_series(self) -> None:
        """Compute what bodies lack that have come, or whose Green's function has become complete."""
        background = self._background
        if self._running and (background is None or not background.add(self._missing_series())):
            # It has ended: nothing waits for the thread that changes the scene.
            self._end_series()
            self._begin_series()

    def _end_series(self) -> None:
        background, self._background = self._background, None
        if background is not None:
            background.close()

    def _offer_series(self) -> None:
        """Hand what is known over again, to a loop whose bodies or tools have changed."""
        for rank, body in enumerate(self.bodies):
            for radius, known in body.series:
                if known is not None:
                    _native.set_series(self._core, rank, radius, known)

    def _take_series(self, job: SeriesJob, series: _native.Series) -> None:
        with self._editing:
            rank = self._rank_of_job(job)
            if rank is None:
                return
            _native.set_series(self._core, rank, job.radius, series)
            body = self.bodies[rank]
            known = tuple((radius, series if radius == job.radius else old) for radius, old in body.series)
            bodies = list(self.bodies)
            bodies[rank] = replace(body, series=known)
            self.bodies = tuple(bodies)

    def _hold_series(self) -> dict[str, str]:
        """Have the loop take up no more until the recording ends; return the text about what it has."""
        known: list[list[tuple[float, list[bool]]]] = [[] for _ in self.bodies]
        for tool, body, blocks in _native.hold_series(self._core, True):
            radius = float(self.scene.tools[tool].radius)
            if radius not in [of for of, _ in known[body]]:
                known[body].append((radius, blocks))
        return {"series": series_text(known)}

    def _rank_of_job(self, job: SeriesJob) -> int | None:
        keys = [body.green.key for body in self.bodies]
        return keys.index(job.key) if job.key in keys else None

    def _pressed_place(self, job: SeriesJob) -> tuple[float, float, float] | None:
        """Position of a tool of the job's radius, in the frame of its body, m."""
        rank = self._rank_of_job(job)
        if rank is None:
            return None
        places = [place for _, place in _native.tool_positions(self._core)]
        if not places:
            return None
        inside = self.bodies[rank].points_to_body(np.array(places))
        x, y, z = inside[0].tolist()
        return x, y, z
