"""What may be changed while the loop of a simulation runs."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate import _native
from palpate.errors import SceneError
from palpate.scene import BuiltBody
from palpate.simulation import settings
from palpate.simulation.script import strike_of


class Adjustable:
    """Settings of a simulation: kept here, and handed to the loop."""

    bodies: tuple[BuiltBody, ...]
    _core: _native.SimulationCore
    _scales: list[float]
    _radii: list[float]
    _friction: list[float]
    _strain_limit: float
    _armed: bool
    # Held while what is kept here of the settings changes.
    _keeping: threading.Lock

    def set_radius(self, contact_radius: float | str, tool: int | None = None) -> None:
        """Contact radius of contacts that begin from now on, m, of one tool or of all.

        Raises
        ------
        Error
            A radius under which a contact would cover more nodes than a tick can weigh.

        """
        tools = range(len(self._radii)) if tool is None else [self._tool(tool)]
        radius = settings.checked_radius(contact_radius)
        for changed in tools:
            self._core.set_contact_radius(changed, radius)
            self._keep("_radii", changed, radius)

    def set_friction(self, friction: float, tool: int | None = None) -> None:
        """Coulomb's coefficient of friction from now on, of one tool or of all; 0 slides freely.

        Raises
        ------
        SceneError
            A coefficient that is negative, or greater than 10.

        """
        coefficient = settings.checked_friction(friction)
        tools = range(len(self._friction)) if tool is None else [self._tool(tool)]
        for changed in tools:
            self._core.set_friction(changed, coefficient)
            self._keep("_friction", changed, coefficient)

    def friction_of(self, tool: int = 0) -> float:
        """Coulomb's coefficient of friction of a tool."""
        return self._friction[self._tool(tool)]

    def contact_radius_of(self, tool: int = 0) -> float:
        """Contact radius of contacts of a tool that begin from now on, m."""
        return self._radii[self._tool(tool)]

    @property
    def contact_radius(self) -> float:
        """Contact radius of contacts of the first tool that begin from now on, m."""
        return self._radii[0]

    def largest_contact_radius(self, limit: float) -> float:
        """Largest contact radius up to ``limit`` (m) that can be weighed everywhere, to about a hundredth."""
        return min(body.green.largest_contact_radius(limit) for body in self.bodies)

    def youngs_modulus_of(self, body: int = 0) -> float | None:
        """Young's modulus of a body now, Pa; None for one of several materials, with loads, or in motion."""
        reference = self.bodies[self._body(body)].green.youngs_modulus
        fixed = reference is None or self.bodies[body].motion is not None
        return None if fixed else reference * self._scales[body]

    @property
    def youngs_modulus(self) -> float | None:
        """Young's modulus of the first body now, Pa, as of :meth:`youngs_modulus_of`."""
        return self.youngs_modulus_of()

    def stiffness_scale_of(self, body: int = 0) -> float:
        """Young's modulus of a body now over that of its Green's function."""
        return self._scales[self._body(body)]

    @property
    def stiffness_scale(self) -> float:
        """Young's modulus of the first body now over that of its Green's function."""
        return self._scales[0]

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
        scale = settings.checked_modulus(youngs_modulus) / reference
        self._core.set_stiffness_scale(body, scale)
        self._keep("_scales", body, scale)

    def set_strain_limit(self, strain_limit: float) -> None:
        """Largest strain to which tools may take the bodies from now on; 0 takes the limit away.

        Raises
        ------
        SceneError
            A limit below 0 or above 1.

        """
        self._strain_limit = settings.checked_strain_limit(strain_limit)
        self._arm_strain_limit()
        self._core.set_strain_limit(self._strain_limit)

    def _arm_strain_limit(self) -> None:
        """Give the loop what measures strain, once it is asked to limit it: it takes a factor of every body."""
        if self._strain_limit > 0 and not self._armed:
            for rank, body in enumerate(self.bodies):
                self._core.set_strain_measure(rank, body.green.native_strain_measure)
            self._armed = True

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
        self._core.strike(struck, *strike_of(point, impulse, duration), self._radii[0])

    def set_time_scale(self, time_scale: float) -> None:
        """Seconds that bodies in motion advance in a second, in (0, 1]: below one is slow motion.

        Raises
        ------
        SceneError
            No body moves, or a scale outside of (0, 1].

        """
        self._moving_body("slow motion", None)
        self._core.set_time_scale(settings.checked_time_scale(time_scale))

    def watch(self, node: int, body: int = 0) -> None:
        """Log the displacement of a surface node (mesh index) from now on; at first it is the lowest one's.

        Raises
        ------
        SceneError
            A node that is not on the surface.

        """
        self._core.watch(self._body(body), self._rank_of(node, body))

    def _keep(self, name: str, rank: int, value: Any) -> None:
        """Keep what is set of a tool or body, which another thread may have removed meanwhile."""
        with self._keeping:
            values = getattr(self, name)
            if rank < len(values):
                values[rank] = value

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

    def _tool(self, tool: int) -> int:
        if not 0 <= tool < len(self._radii):
            raise SceneError(f"there is no tool {tool}: the scene has {len(self._radii)}")
        return tool

    def _body(self, body: int) -> int:
        if not 0 <= body < len(self.bodies):
            raise SceneError(f"there is no body {body}: the scene has {len(self.bodies)}")
        return body
