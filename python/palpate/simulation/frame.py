"""Frames: the latest tick of a running loop, with its bodies and contacts, and the texts of warnings about them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.dynamics import Energy
from palpate.equality import ComparedByValue
from palpate.fields import DeformedSurface, Exportable, Result, ResultSource, placed, together
from palpate.scene import BuiltBody, ToolTable
from palpate.units import count_text
from palpate.vectors import brief

if TYPE_CHECKING:
    import meshio

PERCENTILES = ("p50", "p99", "p999", "max")
STATISTICS = ("ticks", "missed_deadlines", "missed_computing", "dropped_rows", "fault", "realtime", "refused")
# From this thickness on, over the tool's radius, a layer on a table is as accurate as a block for the half-space of the
# local law: docs/accuracy.md.
THICK = 1.5


@dataclass(frozen=True, eq=False, repr=False)
class Contact(ComparedByValue):
    """Contact of a tool with a body. Compared by value, number by number; not hashable.

    Attributes
    ----------
    tool, body
        Their numbers.
    mode
        ``"press"``, or ``"grab"`` for a tool that holds on.
    point, normal
        Contact point on the untouched surface (3,), m, of a tool that slides the centre of pressure, and its outward
        normal (3,), in the world.
    force, torque
        On the body (3,), N, and about the tip (3,), N m, in the world.
    anchor
        Where the tool carries no force (3,), m, in the world: the tool's displacement from there is that of the patch.
    displacement
        Displacement of the tool from the anchor (3,), m, in the world, up to the limit of strain.
    limited
        Whether the tool goes farther than that.
    slipping
        Whether a contact under the local law slips; one that sticks to its patch never does.
    radius
        Contact radius under the local law, m; what follows is 0 under the others.
    depth
        Approach of the tool and the untouched surface, m: how far it has come from first touch.
    stiffness
        Felt along the normal, N/m: change of the force with the depth.
    error
        Estimated relative error of the force, for a material with a law beyond small strain; None for a linear one.
    nodes, weights
        (k,) nodes of the body's mesh in the patch, and their weights (k,), which sum to one.

    """

    tool: int
    body: int
    mode: str
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    anchor: np.ndarray
    displacement: np.ndarray
    limited: bool
    slipping: bool
    radius: float
    depth: float
    stiffness: float
    error: float | None
    nodes: np.ndarray
    weights: np.ndarray
    # Point and normal as the tick has them, in the body's own frame.
    _own_point: np.ndarray = field(compare=False)
    _own_normal: np.ndarray = field(compare=False)

    def __repr__(self) -> str:
        place = f"{len(self.nodes)} nodes around {brief(self.point)} m"
        stated = "" if self.error is None else f" within {100 * self.error:.2g} %"
        return f"Contact(tool {self.tool}, {self.mode}, {place}, force {brief(self.force)} N{stated})"


@dataclass(frozen=True, eq=False, repr=False)
class BodyFrame(ComparedByValue, Result):
    """A body at the latest tick. Compared by value, number by number; not hashable.

    Attributes
    ----------
    displacements
        (s, 3) m, in the body's own frame; rows follow the surface nodes. The surface of a hyperelastic body meets the
        tools under the local law: the indentation, which is smaller than the elements, is added.
    energy
        Of a body in motion, else None.

    """

    displacements: np.ndarray
    energy: Energy | None
    _source: ResultSource = field(compare=False)
    _place: BuiltBody = field(compare=False)
    _stiffness_scale: float = field(default=1.0, compare=False)

    @property
    def _is_hyperelastic(self) -> bool:
        return self._place.is_hyperelastic

    def in_scene(self) -> meshio.Mesh:
        """Give :meth:`to_meshio` where the body stands in the scene."""
        return placed(self.to_meshio(), self._place.points_to_scene, self._place.vectors_to_scene)

    def surface_in_scene(self) -> DeformedSurface:
        """Surface to be drawn where the body stands in the scene."""
        own, place = self.deformed_surface(), self._place
        moved = place.vectors_to_scene(own.displacements)
        return DeformedSurface(place.points_to_scene(own.positions), own.triangles, moved)

    def __repr__(self) -> str:
        largest = np.linalg.norm(self.displacements, axis=1).max(initial=0.0)
        return f"BodyFrame({len(self.displacements)} surface nodes, largest displacement {1e3 * largest:.4g} mm)"


@dataclass(frozen=True, eq=False, repr=False)
class Frame(ComparedByValue, Exportable):
    """The latest tick. Compared by value, number by number; not hashable.

    Attributes
    ----------
    time
        Since the start, s.
    forces, torques
        (tools, 3) N on the devices, and (tools, 3) N m about the tips.
    positions, orientations
        (tools, 3) m of the devices, and (tools, 4) unit quaternions w x y z.
    active
        (tools,) whether each tool is in the scene.
    limited
        (tools,) whether the limit of strain keeps each tool from following its device.
    contacts
        One for each place at which a tool touches a body: up to three a tool and body under the local law.
    bodies
        One a body of the scene.
    statistics
        ``compute_us`` and ``wakeup_us`` (p50, p99, p999, max), ``ticks``, ``missed_deadlines``, of them
        ``missed_computing`` (by ticks that took longer than a period, the others by waking up late), ``refused``
        (for each tool None or why no contact began), ``fault`` (None or what is wrong), ``realtime`` (priority
        granted, memory locked) and ``port_energy`` (for each tool J given to the hand, owed by the safety stage, and
        never paid back). Also ``thin``: for each tool whether it touches a part that is thinner than one and a half of
        its radii. There the force of the local law is too small, by up to 60 % (docs/accuracy.md).

    """

    time: float
    forces: np.ndarray
    torques: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray
    active: np.ndarray
    limited: np.ndarray
    contacts: list[Contact]
    bodies: tuple[BodyFrame, ...]
    statistics: dict

    def __repr__(self) -> str:
        forces = ", ".join(brief(force) for force in self.forces)
        contacts = count_text(len(self.contacts), "contact")
        return f"Frame({self.time:.3f} s, {contacts}, forces on the devices {forces} N)"

    def to_meshio(self) -> meshio.Mesh:
        """All bodies at rest in the scene with displacement, strain and stress at the nodes, as a mesh of meshio.

        The data are those of :meth:`palpate.Touch.to_meshio`; ``body`` numbers the cells. Fields that a body from a
        bare store does not have are NaN.
        """
        return together([body.in_scene() for body in self.bodies])

    def _drawn_surfaces(self) -> list[DeformedSurface]:
        return [body.surface_in_scene() for body in self.bodies]

    @property
    def displacements(self) -> np.ndarray:
        """Of the first body, (s, 3) m."""
        return self.bodies[0].displacements

    @property
    def energy(self) -> Energy | None:
        """Of the first body that moves; None if none does."""
        return next((body.energy for body in self.bodies if body.energy is not None), None)

    @property
    def largest_error(self) -> float | None:
        """Largest estimated relative error of the forces of the contacts; None if none states one."""
        return max((contact.error for contact in self.contacts if contact.error is not None), default=None)

    @property
    def largest_strain(self) -> float:
        """Largest principal strain in magnitude over the surfaces of all bodies; milliseconds, when read."""
        return max(body.largest_strain for body in self.bodies)

    @property
    def within_linear_range(self) -> bool:
        """Whether the largest strain is within the 10 % up to which linear elasticity is accurate."""
        return all(body.within_linear_range for body in self.bodies)


def frame_of(raw: dict[str, Any], bodies: Sequence[BuiltBody]) -> Frame:
    """Frame of a tick as the native module hands it out, of a running loop or of one made again."""
    statistics = {name: raw[name] for name in (*STATISTICS, "port_energy")}
    for name in ("compute_us", "wakeup_us"):
        statistics[name] = dict(zip(PERCENTILES, raw[name], strict=True))
    moved = tuple(
        BodyFrame(surface.reshape(-1, 3), None if energy is None else Energy(*energy), body.green, body, scale)
        for body, (surface, energy, scale) in zip(bodies, raw["bodies"], strict=True)
    )
    tools = [np.array(raw[k]) for k in ("forces", "torques", "positions", "orientations", "active", "limited")]
    contacts = [contact_of(record, bodies) for record in raw["contacts"]]
    return Frame(raw["time"], *tools, contacts, moved, statistics)


def contact_of(record: tuple[Any, ...], bodies: Sequence[BuiltBody]) -> Contact:
    """Contact as the native module hands it out, with the nodes of the body's mesh."""
    tool, body, mode, vectors, flags, (*numbers, error), nodes, weights, own = record
    nodes, place = bodies[body].green.surface_nodes[nodes], map(np.array, own)
    numbers.append(error or None)
    return Contact(tool, body, mode, *map(np.array, vectors), *flags, *numbers, nodes, np.array(weights), *place)


def thin_places(contacts: Sequence[Contact], tools: Sequence[ToolTable], bodies: Sequence[BuiltBody]) -> list[bool]:
    """For each tool whether it touches a part, under the local law, that is thinner than 1.5 of its radii."""
    thin = [False] * len(tools)
    for contact in contacts:
        if contact.radius > 0 and not thin[contact.tool]:
            green, thickness = bodies[contact.body].green, THICK * _size(tools[contact.tool])
            thin[contact.tool] = green.is_thin_at(contact._own_point, contact._own_normal, thickness)
    return thin


def _size(tool: ToolTable) -> float:
    """Radius of a tool, m; of an ellipsoid the smallest semi-axis."""
    return min(tool.semi_axes) if tool.semi_axes is not None else tool.radius or 0.0


def error_text(error: float) -> str:
    """Warning of the largest estimated relative error of a force."""
    return (
        f"the force of a contact may be off by {100 * error:.2g} % (`error` of the contacts): press less deep, or "
        "make the elements smaller"
    )


def limit_text(what: str, bodies: Iterable[BuiltBody], strain_limit: float) -> str:
    """Warning of a tool, which ``what`` names, that was held."""
    if any(body.is_hyperelastic for body in bodies):
        return (
            f"{what} was held where the law of its material ends, so the force stays as it was at that depth: "
            "press less deep"
        )
    return (
        f"{what} was held at the strain limit of {100 * strain_limit:.0f} % (view.strain_limit): its "
        f"force stays as it was at that depth; press less deep"
    )


def refused_text(tick: int, reason: str) -> str:
    """Warning of a tool that was in a body without a force."""
    return f"a tool reached a body without a force, first in tick {tick}: {reason}"
