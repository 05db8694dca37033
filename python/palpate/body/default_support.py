"""Defaults of a body: what holds it, and the node to strike or to watch."""

from __future__ import annotations

import numpy as np

from palpate.body.body import Body
from palpate.mesh import TetMesh
from palpate.mesh.shape_functions import surface_integrals

# Share of the surface's area that is held. A share of the height would hold a scan that stands on the tip of an ear by
# that tip alone. The lower face of a cube has a sixth of its area.
HELD_SHARE = 0.15
# Faces that end within this share of the height above the lowest ones are held with them: a floor is never quite even.
LEVEL = 0.005


def lowest_part(mesh: TetMesh) -> str:
    """Predicate of the nodes below a height, so that at least `HELD_SHARE` of the surface's area lies there."""
    return f"z < min + {1e3 * lowest_height(mesh):.3g}mm"


def lowest_height(mesh: TetMesh) -> float:
    """Height of that part above the lowest node, m."""
    faces, heights = mesh.surface_faces, mesh.nodes[:, 2]
    tops = heights[faces].max(axis=1)
    areas = surface_integrals(mesh.nodes, faces)[0].sum(axis=1)
    upwards = np.argsort(tops, kind="stable")
    held = np.cumsum(areas[upwards])
    last = upwards[np.searchsorted(held, HELD_SHARE * held[-1])]
    low, high = mesh.bounds[:, 2]
    return float(tops[last] - low + LEVEL * (high - low))


def free_end(body: Body) -> int:
    """Free surface node farthest from the supports; the highest of several."""
    free = np.setdiff1d(body.mesh.surface_nodes, body.fixed_nodes)
    nodes, support = body.mesh.nodes[free], body.mesh.nodes[body.fixed_nodes].mean(axis=0)
    # To the micrometre: nodes that are equally far by symmetry must not differ by round-off.
    distance = np.linalg.norm(nodes - support, axis=1).round(6)
    return int(free[np.lexsort((nodes[:, 2], distance))[-1]])
