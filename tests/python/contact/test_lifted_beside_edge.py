"""A sphere slides away from an edge and is lifted: no force comes back at once, and no energy is given out.

Beside the edge passivity has shortened the contact. Where it ends the tool is still below the surface, and the next
contact has to go on from there: it began at its full depth, with 20 % of the largest force in one tick.
"""

from __future__ import annotations

import itertools

import numpy as np

import palpate
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.measures import given_out
from palpate.validation.verify.grids import box

RADIUS, DEPTH, STEP, SIDE = 0.015, 1.5e-3, 2e-5, 0.08
# Places along the face, m, from its edge.
BEGIN, END, HEIGHT = 0.003, 0.02, 0.033
# Largest change in a tick, and what the whole path may give out, over the largest force and the largest work.
JUMP, GIVEN = 0.05, 3e-3


def way(corners: list[tuple[float, float]]) -> np.ndarray:
    """Path through places (x, y), m."""
    at = np.array([(x, y, HEIGHT) for x, y in corners])
    return np.concatenate([at[:1], *(straight(start, end, STEP)[1:] for start, end in itertools.pairwise(at))])


def test_a_contact_that_has_been_shortened_does_not_begin_anew_on_lifting():
    mesh = box((10, 10, 7), (SIDE, SIDE, 0.05), quadratic=True)
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=lambda at: at[:, 2] < 1e-9)
    green = palpate.precompute(body, touch=lambda at: at[:, 0] > 0.04, progress=False)
    high, low = SIDE + RADIUS + 5e-4, SIDE + RADIUS - DEPTH
    path = way([(high, BEGIN), (low, BEGIN), (low, END), (high, END), (high, BEGIN)])
    forces = loop_of(body, green, [sphere(RADIUS)]).play(path).computed_forces
    largest = np.linalg.norm(forces, axis=1).max()
    assert largest > 0.05
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < JUMP * largest
    given, most = given_out(path[None], forces[None])
    assert given[0] < GIVEN * most[0]
