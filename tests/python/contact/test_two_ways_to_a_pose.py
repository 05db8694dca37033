"""Without friction the force at a pose is the same, whichever way the tool has come there.

An edge of a coarse organ that turns by a little more than its neighbours is no feature of the body. As a crease
that ends after one element it held a sphere up to a millimetre above the smooth surface beside it: a tool that came in
there was given no force, and felt half of it or less for as long as it slid. A tool that starts inside the body came
into a contact as deep as it was, with all its force at once.
"""

from __future__ import annotations

import numpy as np
import pytest
from crossings import organ_forces, polyline

from palpate.validation.verify.contact.measures import given_out

STEP = 2e-5
# A sphere's radius, m; above the surface of the built-in body, half a radius deep, slid by 10 mm; over that place.
WAYS = {
    "liver": (
        0.004,
        [(-0.02983, -0.04569, 0.02566), (-0.03256, -0.04437, 0.02964), (-0.02529, -0.04483, 0.03649)],
        (-0.02256, -0.04615, 0.03251),
    ),
    "doll": (
        0.008,
        [(-0.05916, -0.10662, 0.08022), (-0.05995, -0.11112, 0.07492), (-0.05594, -0.10607, 0.06728)],
        (-0.05515, -0.10157, 0.07258),
    ),
}
# Parts of the largest force, and of the largest energy.
APART, LOST = 0.02, 0.01


@pytest.mark.parametrize("name", WAYS)
def test_both_ways_give_one_force(name):
    radius, points, over = WAYS[name]
    sphere = {"shape": "sphere", "radius": radius}
    above, deep, slid = map(np.array, points)
    there = polyline([above, deep, slid], STEP)
    whole = np.concatenate((there, there[::-1]))
    forces = organ_forces(name, sphere, whole)
    other = organ_forces(name, sphere, polyline([above, np.array(over), slid, deep], STEP))
    most = np.linalg.norm(forces, axis=1).max()
    at_deep, at_slid = (len(polyline(corners, STEP)) - 1 for corners in ([above, deep], [above, np.array(over), slid]))
    assert np.linalg.norm(forces[at_deep] - other[-1]) < APART * most
    assert np.linalg.norm(forces[len(there) - 1] - other[at_slid]) < APART * most
    given, energy = given_out(whole[None], forces[None])
    assert abs(given[0]) < LOST * energy[0]


def test_a_tool_that_starts_inside_begins_from_no_force():
    """A stylus through the kidney, which is drawn out a little."""
    stylus = {"shape": "capsule", "radius": 0.003, "length": 0.018}
    start, deep, slid = (-0.0007, 0.0351, 0.0258), (-0.0007, 0.0307, 0.0269), (0.0069, 0.0316, 0.0204)
    path = polyline([np.array(point) for point in (start, deep, slid)], STEP)
    felt = organ_forces("kidney", stylus, path, (0.1213, 0.0452, -0.6434, 0.7545))
    assert np.linalg.norm(np.diff(felt, axis=0), axis=1).max() < 1e-3
