"""Answers of a Green's function."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.equality import ComparedByValue
from palpate.fields import Result, ResultSource
from palpate.vectors import brief


@dataclass(frozen=True, eq=False, repr=False)
class Answer(ComparedByValue, Result):
    """Solution of a changed boundary value problem. Compared by value, number by number; not hashable.

    Attributes
    ----------
    displacements
        (s, 3) m; rows follow the surface nodes.
    forces
        (s, 3) N, `K u` at the surface nodes: applied loads, contact forces and support reactions.
    reactions
        (f, 3) N, `K u` at the body's fixed nodes.

    """

    displacements: np.ndarray
    forces: np.ndarray
    reactions: np.ndarray
    _source: ResultSource = field(repr=False, compare=False)

    def _at_surface_nodes(self) -> dict[str, np.ndarray]:
        return {"force": self.forces}

    def __repr__(self) -> str:
        moved, force = (np.linalg.norm(field, axis=1).max() for field in (self.displacements, self.forces))
        return f"Answer(largest displacement {1e3 * moved:.4g} mm, largest nodal force {force:.4g} N)"


@dataclass(frozen=True, eq=False, repr=False)
class Touch(ComparedByValue, Result):
    """Answer to a patch contact. Compared by value, number by number; not hashable.

    Attributes
    ----------
    force
        On the body (3,), N.
    displacements
        (s, 3) m; rows follow the surface nodes.
    point
        Where it landed (3,), m: the point of the unloaded surface closest to the one asked for.
    distance
        From the one to the other, m.

    """

    force: np.ndarray
    displacements: np.ndarray
    point: np.ndarray
    distance: float
    _source: ResultSource = field(repr=False, compare=False)

    def __repr__(self) -> str:
        moved = np.linalg.norm(self.displacements, axis=1).max()
        force = f"force {brief(self.force)} N at {brief(self.point)} m"
        return f"Touch({force}, largest displacement {1e3 * moved:.4g} mm)"
