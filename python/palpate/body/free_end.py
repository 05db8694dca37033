"""Default node to strike or to watch."""

from __future__ import annotations

import numpy as np

from palpate.body.body import Body


def free_end(body: Body) -> int:
    """Free surface node farthest from the supports; the highest of several."""
    free = np.setdiff1d(body.mesh.surface_nodes, body.fixed_nodes)
    nodes, support = body.mesh.nodes[free], body.mesh.nodes[body.fixed_nodes].mean(axis=0)
    # To the micrometre: nodes that symmetry puts equally far must not be told apart by round-off.
    distance = np.linalg.norm(nodes - support, axis=1).round(6)
    return int(free[np.lexsort((nodes[:, 2], distance))[-1]])
