"""What is read of a running loop: the latest tick and its contacts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.dynamics import Energy
from palpate.equality import ComparedByValue
from palpate.fields import Strained, StrainSource
from palpate.vectors import brief


@dataclass(frozen=True, eq=False, repr=False)
class Contact(ComparedByValue):
    """Contact of one tool. Compared by value, number by number; not hashable.

    Attributes
    ----------
    tool
        Its number.
    mode
        ``"press"``, or ``"grab"`` for a tool that holds on.
    point
        Contact point on the deformed surface (3,), m.
    normal
        Outward normal of the surface there (3,).
    force
        On the body (3,), N.
    anchor
        Where the tool carries no force (3,), m: the tool's displacement from there is that of the patch.
    nodes, weights
        (k,) nodes of the mesh in the patch, and their weights (k,), which sum to one.

    """

    tool: int
    mode: str
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    anchor: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray

    def __repr__(self) -> str:
        place = f"{len(self.nodes)} nodes around {brief(self.point)} m"
        return f"Contact(tool {self.tool}, {self.mode}, {place}, force {brief(self.force)} N)"


@dataclass(frozen=True, eq=False, repr=False)
class Frame(ComparedByValue, Strained):
    """The latest tick. Compared by value, number by number; not hashable.

    Attributes
    ----------
    time
        Since the start, s.
    forces
        (tools, 3) N on the devices.
    positions
        (tools, 3) m of the tools.
    displacements
        (s, 3) m; rows follow the surface nodes.
    contacts
        Of the tools that touch.
    statistics
        ``compute_us`` and ``wakeup_us`` (p50, p99, p999, max), ``ticks``, ``missed_deadlines``, ``fault`` (None or
        what is wrong) and ``realtime`` (priority granted, memory locked).
    energy
        Of a body in motion, else None.

    """

    time: float
    forces: np.ndarray
    positions: np.ndarray
    displacements: np.ndarray
    contacts: list[Contact]
    statistics: dict
    energy: Energy | None
    _source: StrainSource = field(compare=False)

    def __repr__(self) -> str:
        forces = ", ".join(brief(force) for force in self.forces)
        contacts = f"{len(self.contacts)} contact{'' if len(self.contacts) == 1 else 's'}"
        return f"Frame({self.time:.3f} s, {contacts}, forces on the devices {forces} N)"
