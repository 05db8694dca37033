"""Bodies that take long to compute are touched early: at first around their highest point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.body import Body
from palpate.green import Plan, plan
from palpate.green.job import Job

# A body that takes longer than this, s, is touched first within this part of its longest side.
LONG, FIRST_SHARE = 20.0, 0.15


@dataclass(frozen=True)
class Expected:
    """What computing a body comes to.

    Attributes
    ----------
    plan
        None for a body whose store is there.
    first
        Centre, m, and radius, m, of the ball that is computed first; None where all of it is soon done.

    """

    plan: Plan | None
    first: tuple[tuple[float, float, float], float] | None = None

    @classmethod
    def of(cls, body: Body) -> Expected:
        """Look for the store of a body, or plan it.

        Raises
        ------
        Error
            A body that cannot be computed, or files without room.

        """
        if Job.of(body, None, None, None, None).stored() is not None:
            return cls(None)
        planned = plan(body)
        if planned.seconds < LONG:
            return cls(planned)
        nodes = body.mesh.nodes[body.mesh.surface_nodes]
        x, y, z = nodes[nodes[:, 2].argmax()].tolist()
        return cls(planned, ((x, y, z), FIRST_SHARE * float(np.ptp(nodes, axis=0).max())))
