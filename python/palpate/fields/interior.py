"""Displacements inside a body from those of its surface, for the cut-away view."""

from __future__ import annotations

import numpy as np

from palpate import _native
from palpate.body import Body, problem_arrays
from palpate.errors import BodyError
from palpate.vectors import number_array


class Interior:
    """Finite element solution inside a supported body whose surface displacements are known.

    ``K_II u_I = F_I - K_IS u_S`` for any contact and any supports on the surface; ``F`` are the body's own loads. One
    sparse solve, milliseconds: for frames, not for the force loop.
    """

    def __init__(self, body: Body):
        self._surface = len(body.mesh.surface_nodes)
        self.core = _native.Interior(problem_arrays(body, None))

    def extend(self, displacements: np.ndarray) -> np.ndarray:
        """Displacements of all nodes, (n, 3) m, from (s, 3) m at the surface nodes."""
        given = number_array(displacements, "displacements", BodyError)
        if given.shape != (self._surface, 3) or not np.isfinite(given).all():
            raise BodyError(f"displacements must be finite and of shape ({self._surface}, 3), got {given.shape}")
        return self.core.extend(given.ravel()).reshape(-1, 3)
