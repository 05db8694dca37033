"""Without friction the force at a pose is the same, whichever way the tool has come there.

An edge of a coarse organ that turns by a little more than its neighbours is no feature of the body. As a crease
that ends after one element it held a sphere up to a millimetre above the smooth surface beside it: a tool that came in
there was given no force, and felt half of it or less for as long as it slid. A tool that starts inside the body came
into a contact as deep as it was, with all its force at once.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from crossings import polyline

import palpate
from palpate.validation.verify.contact.loop import loop_of
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
# Of the largest force; of the largest energy; of the largest force in a tick of 20 um.
APART, LOST, JUMP = 0.02, 0.01, 0.02


@cache
def pressed(name: str) -> tuple[palpate.Body, palpate.GreensFunction]:
    mesh = getattr(palpate.models, name)()
    feet = mesh.nodes[:, 2].min() + 0.008
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=lambda x: x[:, 2] < feet)
    return body, palpate.precompute(body, precision="f32", progress=False)


def forces(name: str, tool: dict, path: np.ndarray, orientation=(1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    turned = np.tile(np.array(orientation) / np.linalg.norm(orientation), (len(path), 1))
    return np.array(loop_of(*pressed(name), [{**tool, "friction": 0.0}]).play(path, turned).computed_forces)


@pytest.mark.parametrize("name", WAYS)
def test_both_ways_give_one_force(name):
    radius, points, over = WAYS[name]
    above, deep, slid = map(np.array, points)
    there, back = polyline([above, deep, slid], STEP), polyline([above, np.array(over), slid, deep], STEP)
    first, second = (forces(name, {"shape": "sphere", "radius": radius}, path) for path in (there, back))
    most = np.linalg.norm(first, axis=1).max()
    at_deep, at_slid = (len(polyline(corners, STEP)) - 1 for corners in ([above, deep], [above, np.array(over), slid]))
    assert np.linalg.norm(first[at_deep] - second[-1]) < APART * most
    assert np.linalg.norm(first[-1] - second[at_slid]) < APART * most
    whole = np.concatenate((there, there[::-1]))
    given, energy = given_out(whole[None], forces(name, {"shape": "sphere", "radius": radius}, whole)[None])
    assert abs(given[0]) < LOST * energy[0]


def test_a_tool_that_starts_inside_begins_from_no_force():
    """A stylus through the kidney, which is drawn out a little."""
    stylus = {"shape": "capsule", "radius": 0.003, "length": 0.018}
    start, deep, slid = (-0.0007, 0.0351, 0.0258), (-0.0007, 0.0307, 0.0269), (0.0069, 0.0316, 0.0204)
    path = polyline([np.array(point) for point in (start, deep, slid)], STEP)
    felt = forces("kidney", stylus, path, (0.1213, 0.0452, -0.6434, 0.7545))
    assert np.linalg.norm(np.diff(felt, axis=0), axis=1).max() < 1e-3
