"""A tool slides away from an edge: it has the force of a straight press, and loses no energy.

On pressure cells, as near a corner before, a sphere had 36 % less force. Passivity had shortened the contact, and where
it ended the next one began at its full depth, with 20 % of the largest force in one tick. An ellipsoid that came back
from an edge kept the slopes of its softer compliance in the memory of its cells, and lost two thirds of its force.
"""

from __future__ import annotations

import numpy as np
import pytest
from crossings import polyline

import palpate
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.measures import given_out
from palpate.validation.verify.grids import box

RADIUS, DEPTH, STEP, SIDE = 0.015, 1.5e-3, 2e-5, 0.08
# Places along the face, m, from its edge.
BEGIN, END, HEIGHT = 0.003, 0.02, 0.033
# Largest change in a tick, and what the whole path may give out, over the largest force and the largest work.
JUMP, GIVEN = 0.05, 2e-4


@pytest.mark.slow
def test_a_contact_that_slides_away_from_an_edge_has_the_force_of_a_straight_press():
    mesh = box((10, 10, 7), (SIDE, SIDE, 0.05), quadratic=True)
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=lambda at: at[:, 2] < 1e-9)
    green = palpate.precompute(body, touch=lambda at: at[:, 0] > 0.04, progress=False)
    high, low = SIDE + RADIUS + 5e-4, SIDE + RADIUS - DEPTH
    corners = [(high, BEGIN), (low, BEGIN), (low, END), (high, END), (high, BEGIN)]
    path = polyline([(x, y, HEIGHT) for x, y in corners], STEP)
    loop = loop_of(body, green, [sphere(RADIUS)])
    forces = loop.play(path).computed_forces
    largest = np.linalg.norm(forces, axis=1).max()
    assert largest > 0.05
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < JUMP * largest
    given, most = given_out(path[None], forces[None])
    assert abs(given[0]) < GIVEN * most[0]
    slid = forces[np.flatnonzero((path[:, 0] == low) & (path[:, 1] == END))[0]]
    pressed = loop.play(polyline([(high, END, HEIGHT), (low, END, HEIGHT)], STEP)).computed_forces[-1]
    assert np.linalg.norm(slid - pressed) < 1e-3 * np.linalg.norm(pressed)


def test_an_ellipsoid_that_comes_back_from_an_edge_has_its_force_again():
    """Half a millimetre deep in a hard block, its long axis across the edge, from 7 mm to 0.8 mm beside it and back."""
    mesh = box((10, 10, 7), (SIDE, SIDE, 0.05), quadratic=True)
    body = palpate.Body(mesh, material=palpate.Material(100e3, 0.45), fixed=lambda at: at[:, 0] > SIDE - 1e-9)
    green = palpate.precompute(body, touch=lambda at: at[:, 0] < 1e-9, progress=False)
    tool = {"shape": "ellipsoid", "semi_axes": (0.004, 0.003, 0.003), "contact": "local", "friction": 0.0}
    clear, deep = -0.0035, -0.0025
    corners = [(clear, 0.043), (deep, 0.043), (deep, 0.0492), (deep, 0.043), (clear, 0.043)]
    path = polyline([(x, 0.04, z) for x, z in corners], 1e-5)
    # Its first axis across the edge, its third one out of the face.
    turned = np.tile([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0], (len(path), 1))
    forces = loop_of(body, green, [tool]).play(path, turned).computed_forces
    places = np.flatnonzero(path[:, 0] == deep)
    before, after = forces[places[0]], forces[places[-1]]
    assert abs(before[2]) < 0.01 * abs(before[0])
    assert np.linalg.norm(after - before) < 2e-3 * np.linalg.norm(before)
    given, most = given_out(path[None], forces[None])
    assert abs(given[0]) < GIVEN * most[0]
