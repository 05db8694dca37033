"""A tool beside a boundary of two materials that reaches the surface.

The law blends the inverse of the modulus between nodes, as the half-spaces that are taken off the body's compliance are
blended. Where it blended the modulus, a soft layer beside one ten times stiffer was felt up to 2.4 times too stiff, and
beside one a thousand times stiffer the force stood still while the tool went on.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import palpate
from palpate.simulation import Simulation
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.grids import box

RADIUS, DEPTHS, START, TICK = 6e-3, np.array([0.5e-3, 1e-3, 1.5e-3]), 0.2e-3, 1e-5
SIZE, BOUNDARY = (0.08, 0.08, 0.05), 0.025
# Forces on the side face at heights, m, beside a layer above that is ten times stiffer, N: a direct solution, as in
# `edge_block.py`, on elements of 1 mm with the boundary between them.
DIRECT = {
    0.021: (0.01625, 0.04716, 0.08809),
    0.0235: (0.02705, 0.0927, 0.17904),
    0.029: (0.08779, 0.21324, 0.35402),
}
# Largest errors on elements of 8 mm, which do not resolve a boundary 1.5 mm away.
ALLOWED = {0.021: 0.16, 0.0235: 0.33, 0.029: 0.29}


@cache
def loop(contrast: float, cells: tuple[int, int, int]) -> Simulation:
    """Loop of a block of two layers, the upper one stiffer, whose side face may be touched."""
    mesh = box(cells, SIZE, quadratic=True)
    upper = mesh.nodes[mesh.tets[:, :4]].mean(axis=1)[:, 2] > BOUNDARY
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, regions=upper.astype(int))
    material = {0: palpate.Material(10e3, 0.45), 1: palpate.Material(contrast * 10e3, 0.45)}
    body = palpate.Body(mesh, material=material, fixed=lambda at: at[:, 2] < 1e-9)
    touched = lambda at: (at[:, 0] < 0.045) & (np.abs(at[:, 1] - 0.041) < 0.036)  # noqa: E731
    green = palpate.precompute(body, touch=touched, progress=False)
    return loop_of(body, green, [sphere(RADIUS)])


def pressed(contrast: float, cells: tuple[int, int, int], height: float) -> tuple[np.ndarray, np.ndarray]:
    """Depths, m, and forces, N, of a sphere pressed into the side face."""
    path = straight((-RADIUS - START, 0.041, height), (DEPTHS[-1] - RADIUS, 0.041, height), TICK)
    forces = loop(contrast, cells).play(path).computed_forces
    return path[:, 0] + RADIUS, -forces[:, 0]


@pytest.mark.parametrize("height", DIRECT)
def test_the_force_beside_a_stiffer_layer(height):
    depths, forces = pressed(10.0, (10, 10, 8), height)
    errors = np.interp(DEPTHS, depths, forces) / DIRECT[height] - 1.0
    assert np.abs(errors).max() < ALLOWED[height], errors


@pytest.mark.parametrize("height", [0.012, 0.021, 0.0245, 0.0255, 0.032])
@pytest.mark.parametrize("contrast", [100.0, 1000.0])
def test_no_force_stands_still_beside_a_much_stiffer_layer(contrast, height):
    depths, forces = pressed(contrast, (6, 6, 4), height)
    touching = forces[depths > 2 * TICK]
    assert (np.diff(touching) > 0.0).all()
    soft = pressed(1.0, (6, 6, 4), height)[1][depths > 2 * TICK]
    # By the energy a body with a stiffer part is no softer, and no stiffer than one that is so stiff everywhere.
    assert (touching > 0.98 * soft).all() and (touching < 1.02 * contrast * soft).all()
