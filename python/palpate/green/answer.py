"""Answers of a Green's function."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.equality import ComparedByValue
from palpate.fields import Result, ResultSource
from palpate.green.bounds import error_text
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
    error
        Estimated relative error, 1 is all: largest error of a nodal force or reaction over the largest of them, or of a
        displacement over the largest, whichever is larger. Supports that move as one take no force: what is computed is
        compared with a bound of its rounding. It is the error of solving this finite element model with numbers of the
        store's precision, not that of the model (docs/accuracy.md).

    """

    displacements: np.ndarray
    forces: np.ndarray
    reactions: np.ndarray
    error: float
    _source: ResultSource = field(repr=False, compare=False)

    def _at_surface_nodes(self) -> dict[str, np.ndarray]:
        return {"force": self.forces}

    def __repr__(self) -> str:
        moved, force = (np.linalg.norm(field, axis=1).max() for field in (self.displacements, self.forces))
        largest = f"largest displacement {1e3 * moved:.4g} mm, largest nodal force {force:.4g} N"
        return f"Answer({largest}, right to {error_text(self.error)})"


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
    error
        Estimated relative error, 1 is all: of the force over it, or of a displacement over the largest, whichever is
        larger. A force smaller than the one that would undo the displacement of the body's own loads there is compared
        with that one. It is that of solving this finite element model with numbers of the store's precision, not that
        of the model (docs/accuracy.md).

    """

    force: np.ndarray
    displacements: np.ndarray
    point: np.ndarray
    distance: float
    error: float
    _source: ResultSource = field(repr=False, compare=False)

    def __repr__(self) -> str:
        moved = np.linalg.norm(self.displacements, axis=1).max()
        force = f"force {brief(self.force)} N at {brief(self.point)} m"
        return f"Touch({force}, largest displacement {1e3 * moved:.4g} mm, right to {error_text(self.error)})"
