"""Tools that are no spheres over parts smaller than they are, where one side of a bump looks like a wall.

A contact with such a side began with a force at once, on a plane parallel to that of the contact that was there. Both
pressed on one place: forces jumped by up to a half, and closed paths gave out work.
"""

from __future__ import annotations

import numpy as np
import pytest
from crossings import organ_forces, polyline

from palpate.validation.verify.contact.measures import given_out

CAPSULE = {"shape": "capsule", "radius": 0.004, "length": 0.014}
ELLIPSOID = {"shape": "ellipsoid", "semi_axes": (0.009, 0.006, 0.005)}
STEP = 2e-5
# Of a tool: above the surface, half of its radius deep, slid by 10 mm, m; its orientation.
PATHS = {
    "arm": (
        CAPSULE,
        [(-0.03727, -0.05567, 0.06946), (-0.03788, -0.05521, 0.06656), (-0.03046, -0.04852, 0.06607)],
        (0.2164, -0.8205, -0.1913, 0.4932),
    ),
    "face": (
        ELLIPSOID,
        [(-0.00149, -0.06063, 0.1973), (-0.00127, -0.05938, 0.19351), (-0.00472, -0.06822, 0.19038)],
        (0.2146, -0.607, -0.7533, 0.1344),
    ),
    "shoulder": (
        ELLIPSOID,
        [(-0.03983, -0.02608, 0.1418), (-0.04011, -0.02281, 0.13951), (-0.04644, -0.0276, 0.13343)],
        (0.7046, -0.6651, -0.1473, 0.199),
    ),
}
# Largest change of the force in a tick, over its largest; largest part of the energy that a closed path loses.
JUMP, LOST = 0.04, 0.06


@pytest.mark.parametrize("name", PATHS)
def test_a_bump_is_pressed_once(name):
    tool, points, orientation = PATHS[name]
    above, deep, slid = map(np.array, points)
    path = polyline([above, deep, slid, deep, above], STEP)
    forces = organ_forces("doll", tool, path, orientation)
    sizes = np.linalg.norm(forces, axis=1)
    assert sizes.max() > 0.05
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < JUMP * sizes.max()
    given, most = given_out(path[None], forces[None])
    assert -LOST * most[0] < given[0] < 1e-3 * most[0]
