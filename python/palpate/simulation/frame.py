"""What is read of a running loop: the latest tick and its contacts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.dynamics import Energy
from palpate.fields import Strained, StrainSource


@dataclass(frozen=True)
class Contact:
    """One tool's contact: positions in m, force on the body in N; nodes are mesh indices, weights sum to one.

    ``anchor`` is where the tool carries no force: the tool's displacement from there is that of the patch.
    """

    tool: int
    mode: str
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    anchor: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class Frame(Strained):
    """The latest tick.

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
    contacts: list[Contact] = field(repr=False)
    statistics: dict
    energy: Energy | None
    _source: StrainSource = field(repr=False, compare=False)
