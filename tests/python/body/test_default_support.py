"""Default supports hold a share of the surface, and what hangs by a thread is found."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from conftest import box_mesh

import palpate
from palpate.body import parse
from palpate.body.default_support import HELD_SHARE, lowest_part
from palpate.green.firmness import LOOSE, firmness
from palpate.mesh import TetMesh


def necked(width: float) -> TetMesh:
    """Box of 80 x 50 x 50 mm, slightly slanting, on a neck of its lower two layers that is so many times as wide."""
    mesh = box_mesh(cells=(8, 5, 10), jitter=0.0)
    nodes = mesh.nodes.copy()
    low = nodes[:, 2] < 0.011
    nodes[low, :2] = [0.04, 0.025] + width * (nodes[low, :2] - [0.04, 0.025])
    nodes[:, 2] += 0.05 * nodes[:, 0] * (~low)
    return TetMesh(nodes, mesh.tets)


def held_area(mesh: TetMesh, held: np.ndarray) -> float:
    """Share of the surface whose corners are all held, by trimesh."""
    surface = trimesh.Trimesh(mesh.nodes, mesh.surface_faces[:, :3], process=False)
    return surface.area_faces[held[surface.faces].all(axis=1)].sum() / surface.area


def test_a_box_is_held_at_its_lower_face():
    mesh = box_mesh()
    held = parse(lowest_part(mesh))(mesh.nodes)
    np.testing.assert_array_equal(held, mesh.nodes[:, 2] < 1e-9)


@pytest.mark.parametrize("width", [1.0, 0.3, 0.05])
def test_a_body_on_a_neck_is_held_beyond_it(width):
    mesh = necked(width)
    held = parse(lowest_part(mesh))(mesh.nodes)
    assert HELD_SHARE <= held_area(mesh, held) < 2.5 * HELD_SHARE
    assert width == 1.0 or held[mesh.nodes[:, 2] < 0.011].all()


def firmness_held(mesh: TetMesh, fixed) -> float:
    body = palpate.Body(mesh, material=palpate.Material(1e4, 0.45), fixed=fixed)
    return firmness(palpate.precompute(body), 5e-3)


@pytest.mark.slow
def test_a_body_that_hangs_by_a_thread_is_found():
    mesh = necked(0.05).to_quadratic()
    loose = firmness_held(mesh, lambda nodes: nodes[:, 2] < 1e-9)
    # Bending of the neck, 4 x 2.5 mm and 10 mm long, by a press 40 and 0 to 25 mm aside: k = E / (L sum r^2 / I).
    by_x, by_y = 0.04**2 / (2.5e-3 * 4e-3**3 / 12), 0.025**2 / (4e-3 * 2.5e-3**3 / 12)
    stiffest, softest = (1 / (10e-3 * bends) / (2 * 5e-3) for bends in (by_x, by_x + by_y))
    assert 0.7 * softest < loose < 1.4 * stiffest
    assert loose < LOOSE
    assert firmness_held(mesh, lowest_part(mesh)) > 100 * LOOSE


def test_several_materials_are_not_judged():
    mesh = box_mesh()
    upper = mesh.nodes[mesh.tets, 2].mean(axis=1) > 0.025
    mesh = TetMesh(mesh.nodes, mesh.tets, upper.astype(int))
    material = {0: palpate.Material(1e4, 0.45), 1: palpate.Material(1e6, 0.45)}
    body = palpate.Body(mesh, material=material, fixed=lambda nodes: nodes[:, 2] < 1e-9)
    assert firmness(palpate.precompute(body), 5e-3) is None
