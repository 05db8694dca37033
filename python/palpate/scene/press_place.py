"""Where a script presses a scene: the highest free point of its first body, nearest to the middle."""

from __future__ import annotations

import numpy as np

from palpate.errors import SceneError
from palpate.scene.build import BuiltScene

# How deep a script presses, as a part of the body's longest side: small strains.
DEPTH = 0.03


def press_place(built: BuiltScene) -> tuple[np.ndarray, float]:
    """Where the first tool's origin rests when it just touches from above, m, and how deep it presses, m.

    Raises SceneError for a body whose whole surface is fixed.
    """
    body = built.bodies[0]
    green, nodes = body.green, body.points_to_scene(body.green.surface_positions)
    free = np.flatnonzero(~np.isin(green.surface_nodes, green.fixed_nodes))
    if len(free) == 0:
        raise SceneError("the whole surface is fixed: nothing can be pressed")
    size = float(np.ptp(nodes, axis=0).max())
    highest = free[nodes[free, 2] > nodes[free, 2].max() - 0.01 * size]
    middle = nodes[:, :2].mean(axis=0)
    top = nodes[highest[np.argmin(np.linalg.norm(nodes[highest, :2] - middle, axis=1))]]
    return top + [0, 0, built.scene.tools[0].reach], DEPTH * size
