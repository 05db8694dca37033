"""Several places of one tool on a body, and a tool pushed through a thin part."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.fields import Interior
from palpate.scene import BuiltScene
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact import groove
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes

BARE = {"device": {"max_force": 1e3, "max_slew": 1e9, "ramp": 0, "max_stiffness": 1e9}, "view": {"strain_limit": 0}}
ELLIPSOID = {"shape": "ellipsoid", "semi_axes": (0.008, 0.006, 0.005)}
# What a tool goes in a tick at 2 m/s, m.
GONE = 2e-3


@pytest.fixture(scope="module")
def grooved() -> tuple[palpate.Body, palpate.GreensFunction]:
    body = groove.grooved_body()
    return body, groove.walls(body)


def test_a_sphere_in_a_groove_is_held_by_both_walls_alike(grooved):
    force = groove.pressed(loop_of(*grooved, [sphere(groove.RADIUS)]), 1e-3)
    # One wall alone would push as much across as up.
    assert abs(force[0]) < 0.02 * force[2] and abs(force[1]) < 1e-3 * force[2]
    # Each wall is pressed by 1/sqrt(2) mm; as half-spaces both would give Hertz's force.
    hertz = 4 / 3 * 10e3 / (1 - 0.45**2) * np.sqrt(groove.RADIUS) * (1e-3 / np.sqrt(2)) ** 1.5
    assert abs(force[2] / (np.sqrt(2) * hertz) - 1) < 0.1


def test_sweeps_in_a_groove_have_no_jump_and_never_pull(grooved):
    found = groove.sweeps(loop_of(*grooved, [sphere(groove.RADIUS)]), 3e-3, 2e-6)
    for name, forces in found.items():
        size = np.linalg.norm(forces, axis=1)
        jumps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
        assert (jumps < np.maximum(0.005 * size[1:], 5e-3)).all(), name
        # Within the cone of the two walls' normals.
        assert (forces[:, 2] >= np.abs(forces[:, 0]) * 0.97).all(), name


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_closed_paths_in_a_groove_give_out_nothing_and_repeat_to_the_bit(grooved, friction):
    leaks = [groove.given_out(loop_of(*grooved, [sphere(groove.RADIUS, friction)]), 12) for _ in range(2)]
    assert leaks[0] == leaks[1] and leaks[0] <= 1e-3


def test_forces_of_two_places_balance_the_supports(grooved):
    body, green = grooved
    simulation = loop_of(body, green, [sphere(groove.RADIUS, 0.3)])
    k = np.linspace(0, 1, 12)[:, None]
    path = np.array([0.0, 0.0, groove.TOUCHES + 5e-4]) + k * [5e-4, 1e-3, -2.5e-3]
    played = simulation.play(path, watch=[int(node) for node in body.mesh.surface_nodes])
    interior, stiffness = Interior(body), body.stiffness()
    for force, shape in zip(played.forces, played.displacements, strict=True):
        nodal = (stiffness @ interior.extend(shape).ravel()).reshape(-1, 3)
        reaction = np.where(body.fixed_mask, nodal, 0.0).sum(axis=0)
        assert np.abs(reaction - force).max() <= 1e-9 * np.abs(played.forces).max()


@pytest.mark.parametrize(
    ("tool", "height"), [(sphere(0.01), 0.01), ({**ELLIPSOID, "contact": "local", "friction": 0.0}, 5e-3)]
)
def test_it_does_not_matter_which_of_two_tools_comes_first(tool, height):
    """Without friction forces are the gradient of one energy: the place of the tools alone determines them."""
    block = body_on_table(Block(), (8, 8, 4), quadratic=True)
    simulation = loop_of(block, green_of(block, touch=top_nodes(block)), [tool] * 2)
    low, high = block.mesh.bounds
    ends = [
        [*(low + high)[:2] / 2 + [aside, 0.0], high[2] + height - depth]
        for aside, depth in ((-8e-3, 2e-3), (8e-3, 5e-4))
    ]
    way = np.linspace(3e-3, 0.0, 31)[:, None] * [0.0, 0.0, 1.0]
    there, away = np.zeros_like(way), np.full_like(way, way[0])

    def pressed(first: list, second: list) -> np.ndarray:
        lifts = [np.concatenate(list(lift)) for lift in (first, second)]
        return simulation.run(np.stack([end + lift for end, lift in zip(ends, lifts, strict=True)], axis=1))[-1]

    together = pressed([away, way], [away, way])
    assert together[1, 2] > 0
    for other in (pressed([way, there], [away, way]), pressed([away, way], [way, there])):
        assert np.abs(other - together).max() < 1e-5 * np.abs(together).max()


@pytest.fixture(scope="module", params=[2e-3, 5e-3], ids=["2mm", "5mm"])
def plate(request, tmp_path_factory) -> tuple[float, palpate.Body, palpate.GreensFunction]:
    mesh = box_mesh((10, 10, 1), (0.06, 0.06, request.param)).to_quadratic()
    body = palpate.Body(
        mesh, material=palpate.Material(50e3, 0.45), fixed=lambda p: (p[:, 0] < 1e-9) | (p[:, 0] > 0.0599)
    )
    path = tmp_path_factory.mktemp("plate") / "p.palpate"
    return request.param, body, palpate.precompute(body, precision="f32", path=path)


@pytest.mark.quick(3)
@pytest.mark.parametrize("angle", [0, 30, 45])
@pytest.mark.parametrize(
    ("tool", "height"), [({"radius": 0.005}, 5e-3), ({"radius": 1.5e-3}, 1.5e-3), (ELLIPSOID, 5e-3)]
)
def test_a_tool_pushed_through_a_plate_at_2_m_s_is_pushed_back_to_where_it_came_from(plate, tool, height, angle):
    thickness, body, green = plate
    scene = palpate.Scene(body={"store": "p.palpate"}, tool={"friction": 0.3, **tool}, **BARE)
    simulation = palpate.Simulation(BuiltScene.of(scene, body, green))
    direction = np.array([np.sin(np.radians(angle)), 0.0, -np.cos(np.radians(angle))])
    there = np.arange(16)
    path = np.array([0.03, 0.031, thickness + height + 5e-4]) - 3.3 * GONE * direction
    path = path + np.concatenate([there, there[-2::-1]])[:, None] * GONE * direction
    below = thickness + height - path[:, 2]
    forces = simulation.play(path).forces
    # All of the tool is beyond the plate's other side, and farther.
    assert below.max() > 2 * height + thickness
    assert (forces[:, 2] >= 0).all()
    assert (forces[below > 1e-4, 2] > 0).all()
    assert (forces[below < 0] == 0).all()
