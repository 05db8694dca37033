"""Answers of a Green's function."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.fields import Strained, StrainSource


@dataclass(frozen=True)
class Answer(Strained):
    """Solution of a changed boundary value problem.

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
    _source: StrainSource = field(repr=False, compare=False)


@dataclass(frozen=True)
class Touch(Strained):
    """Answer to a patch contact: force on the body (3,), N, and displacements (s, 3), m."""

    force: np.ndarray
    displacements: np.ndarray
    _source: StrainSource = field(repr=False, compare=False)
