"""Tools on blades: beside a direct solution of a fine mesh, and what must not change their force."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import edge_block
import numpy as np
import pytest
import trimesh
from crossings import Loops, capsule_file, played
from edge_block import Placed, Region, within
from scipy.spatial.transform import Rotation
from strange_bodies import EDGE_LENGTH

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.contact.loop import UNLIMITED

DEPTHS = np.array([0.5e-3, 1e-3, 1.5e-3])
ELEMENT, TOLERANCE = 6e-3, 0.1
BLADE = 60.0
OUT, ALONG = edge_block.outward(BLADE), np.array([0.0, 1.0, 0.0])
ACROSS = np.cross(ALONG, OUT)
UP = np.array([0.0, 0.0, 1.0])
CAPSULE = {"shape": "capsule", "radius": 3e-3, "length": 18e-3}
PUNCH = {"shape": "punch", "radius": 6e-3, "rounding": 1.8e-3}


def turned(axis: np.ndarray, angle: float = 0.0) -> Rotation:
    """Turn that takes a tool's own axis, its z, to an axis, after a spin about it, degrees."""
    frame = np.column_stack([np.cross(ALONG, axis), ALONG, axis])
    return Rotation.from_matrix(frame) * Rotation.from_rotvec([0.0, 0.0, np.radians(angle)])


def across(yaw: float) -> Placed:
    """A capsule whose middle lies on the blade, so many degrees from straight across it."""
    rotation = Rotation.from_rotvec(np.radians(yaw) * OUT) * turned(ACROSS)
    return Placed(CAPSULE, edge_block.capsule(3e-3, 18e-3), rotation, 3e-3 * OUT - 9e-3 * rotation.apply(UP))


POSES = {
    "a capsule across the blade": across(0.0),
    # A round face: its spin is no part of the direct solution.
    "a punch on the blade": Placed(PUNCH, edge_block.punch(6e-3, 1.8e-3), turned(OUT, 40.0), 0.0 * OUT),
    "a sphere of 6 mm": Placed({"radius": 6e-3}, edge_block.sphere(6e-3), turned(OUT), 6e-3 * OUT),
    "a sphere of 3 mm": Placed({"radius": 3e-3}, edge_block.sphere(3e-3), turned(OUT), 3e-3 * OUT),
}
# Along the bisector, N, as `solved_directly` finds them on elements of 0.5 mm.
DIRECT = {
    "a capsule across the blade": (2.69e-3, 7.54e-3, 14.36e-3),
    "a punch on the blade": (10.26e-3, 23.14e-3, 38.41e-3),
    "a sphere of 6 mm": (3.58e-3, 10.18e-3, 19.19e-3),
    "a sphere of 3 mm": (2.67e-3, 7.43e-3, 14.06e-3),
}


def solved_directly(pose: Placed, element: float) -> np.ndarray:
    contact = edge_block.direct_contact(0.0, Region(7e-3, 7e-3, 9e-3, element), BLADE)
    return contact.press(pose.shape, pose.start - DEPTHS[:, None] * OUT, pose.rotation) @ OUT


@pytest.fixture(scope="module")
def blade(tmp_path_factory) -> tuple[palpate.Body, palpate.GreensFunction]:
    body = edge_block.body_of(edge_block.whole_block(0.0, ELEMENT), half=False, degrees=BLADE)
    return body, palpate.precompute(body, precision="f32", path=tmp_path_factory.mktemp("blade") / "blade.palpate")


def pressed(blade, placed: Placed) -> np.ndarray:
    """Forces of the loop along the bisector, N, at the depths."""
    return edge_block.loop_forces(blade, placed, OUT, DEPTHS) @ OUT


@pytest.mark.parametrize("name", POSES)
def test_a_tool_on_a_blade_feels_what_the_direct_solution_does(blade, name):
    forces, direct = pressed(blade, POSES[name]), np.array(DIRECT[name])
    assert within(forces, direct, TOLERANCE).all(), (name, forces / direct - 1)


def test_wrong_forces_are_not_within_the_tolerance():
    for direct in map(np.array, DIRECT.values()):
        late = np.append(direct[:1] / 2, direct[:-1])
        for wrong in (1.15 * direct, 0.85 * direct, -direct, late):
            assert not within(wrong, direct, TOLERANCE).any()


@pytest.mark.slow
@pytest.mark.parametrize("name", POSES)
def test_the_direct_solution_of_a_blade_hardly_changes_with_its_mesh(name):
    pose = POSES[name]
    straight = replace(pose, rotation=turned(OUT)) if pose.tool is PUNCH else pose
    found = solved_directly(straight, 0.7e-3)
    assert np.abs(found / DIRECT[name] - 1).max() <= 0.05, found


def test_a_file_of_a_capsule_is_one(blade, tmp_path):
    capsule = POSES["a capsule across the blade"]
    file = replace(capsule, tool={"shape": str(capsule_file(tmp_path)), "unit": "mm"})
    assert within(pressed(blade, file), pressed(blade, capsule), 0.06).all()


@pytest.mark.parametrize("yaw", [15.0, 30.0, 45.0])
def test_a_capsule_that_lies_obliquely_over_a_blade_has_a_longer_contact(blade, yaw):
    """The blade's edge meets a cylinder in an ellipse, `1/cos(yaw)` times as long as straight across."""
    longer = pressed(blade, across(yaw)) / pressed(blade, across(0.0))
    assert within(longer, np.full(3, 1 / np.cos(np.radians(yaw))), 0.08).all(), longer


def test_a_punch_that_spins_keeps_its_force(blade):
    punch = POSES["a punch on the blade"]
    forces = [pressed(blade, replace(punch, rotation=turned(OUT, spin))) for spin in (0.0, 20.0, 45.0, 80.0)]
    assert all(within(other, forces[0], 0.01).all() for other in forces[1:]), forces


def bar_file(folder: Path) -> Path:
    """Surface file of a bar with sharp edges, 8 x 8 x 20 mm, in mm, from z = -4 to 16."""
    bar = trimesh.creation.box((8.0, 8.0, 20.0))
    bar.apply_translation([0.0, 0.0, 6.0])
    path = folder / "bar.stl"
    bar.export(path)
    return path


@pytest.mark.parametrize("degrees", [30, pytest.param(60, marks=pytest.mark.slow), 90])
def test_a_bar_with_sharp_edges_keeps_its_force_along_its_own_axis(tmp_path, degrees):
    """It lies across a ridge: over the ridge's edge are always the same straight lines."""
    loops = Loops(tmp_path, {})
    body, green = loops.body(f"ridge {degrees}")
    table = {"shape": str(bar_file(tmp_path)), "unit": "mm", "friction": 0.0}
    scene = palpate.Scene(body={"store": "body.palpate"}, tool=table, device=UNLIMITED, view={"strain_limit": 0})
    along = np.arange(-9e-3, -3e-3, 20e-6)
    path = np.column_stack([along, np.full_like(along, EDGE_LENGTH / 2 + 1.7e-3), np.full_like(along, 3e-3)])
    down = np.arange(1.5e-3, 0, -10e-6)[:, None] * UP
    lying = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])
    found = played(palpate.Simulation(BuiltScene.of(scene, body, green)), np.vstack([path[0] + down, path]), lying)
    forces = found.forces[len(down) :]
    upwards = forces[:, 2]
    assert upwards.min() > 5e-3
    assert np.ptp(upwards) < 0.05 * upwards.mean(), (upwards.min(), upwards.max())
    assert np.abs(forces[:, :2]).max() < 0.08 * upwards.mean()
