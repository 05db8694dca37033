"""Two bodies in one scene, placed and turned: forces against one finite element solve in each body's own frame."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh
from direct import patch_at, solve_with_patches
from running import settle

import palpate
from palpate.scene import BuiltBody, BuiltScene
from palpate.vectors import conjugate, rotated

RADIUS, PATCH = 0.01, 0.012
BARE = {"device": {"max_force": 1e3, "max_slew": 1e9, "ramp": 0, "max_stiffness": 1e9}, "view": {"strain_limit": 0}}
# Tops of the two blocks in their own frames, and where the tool lands on them.
TOPS = (0.05, 0.04)
LANDINGS = np.array([[0.041, 0.026, 0.05], [0.033, 0.028, 0.04]])
UP = np.array([0.0, 0.0, 1.0])
# A second tool lands on the second body alone.
BESIDE = np.array([0.043, 0.044, 0.04])


def unit(*numbers: float) -> tuple[float, ...]:
    return tuple((np.array(numbers) / np.linalg.norm(numbers)).tolist())


def product(a, b) -> tuple[float, ...]:
    """Of two quaternions w x y z: first b, then a."""
    (p, *u), (q, *v) = a, b
    return (float(p * q - np.dot(u, v)), *(p * np.array(v) + q * np.array(u) + np.cross(u, v)).tolist())


# The second body leans over the first, so that the tool comes to lie between both.
TURNED = unit(0.7, 0.45, -0.45, -0.25)


@pytest.fixture(scope="module")
def blocks(tmp_path_factory) -> list[tuple[palpate.Body, palpate.GreensFunction]]:
    """Two blocks of other sizes, meshes and materials."""
    folder = tmp_path_factory.mktemp("green")
    result = (
        palpate.Body(box_mesh((6, 4, 4)), material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 2] < 1e-9),
        palpate.Body(
            box_mesh((5, 4, 3), size=(0.06, 0.055, TOPS[1]), seed=3).to_quadratic(),
            material=palpate.Material(25e3, 0.3),
            fixed=lambda p: p[:, 2] < 1e-9,
        ),
    )
    return [(b, palpate.precompute(b, precision="f64", path=folder / f"{i}.palpate")) for i, b in enumerate(result)]


class Placed:
    """The two blocks with one or two tools, moved and turned together by a motion of the whole scene."""

    def __init__(self, blocks, tools: int = 1, shift=(0.0, 0.0, 0.0), turn=(1.0, 0.0, 0.0, 0.0)):
        self.blocks, self.shift, self.turn = blocks, np.array(shift), turn
        # Where the tool touches both: over its landing on the first body; the second is put against it.
        self.centre = LANDINGS[0] + RADIUS * UP
        self.normals = np.array([UP, rotated(UP, TURNED)])
        second = self.centre - RADIUS * self.normals[1] - rotated(LANDINGS[1], TURNED)
        orientations = [(1.0, 0.0, 0.0, 0.0), TURNED]
        self.bodies = [
            BuiltBody(body, green, None, f"block {i}", tuple(self.world(place).tolist()), product(turn, orientation))
            for i, ((body, green), place, orientation) in enumerate(
                zip(blocks, (np.zeros(3), second), orientations, strict=True)
            )
        ]
        tables = [{"store": "block.palpate"}, {"store": "other.palpate"}]
        scene = palpate.Scene(body=tables, tool=[{"radius": RADIUS, "contact_radius": PATCH}] * tools, **BARE)
        self.simulation = palpate.Simulation(BuiltScene(scene, tuple(self.bodies)))

    def world(self, points: np.ndarray) -> np.ndarray:
        """Points of the scene before the motion, after it."""
        return rotated(points, self.turn) + self.shift

    def path(self, end: np.ndarray, ticks: int = 40) -> np.ndarray:
        """Of the first tool (t, 3) in the world: from clear of both bodies by `centre`, to an offset from there."""
        start = 2e-4 * self.normals.sum(axis=0)
        share = np.linspace(0.0, 1.0, ticks)[:, None]
        return self.world(self.centre + start + share * (np.asarray(end) - start))

    def expected(self, rank: int, path: np.ndarray) -> np.ndarray:
        """Force on one body in the world (3,) of the tool at the end of a path that lands on the body's top."""
        body, green = self.blocks[rank]
        own = self.bodies[rank].points_to_body(path)
        first = own[int(np.argmax(own[:, 2] < TOPS[rank] + RADIUS))]
        anchor = np.array([*first[:2], TOPS[rank] + RADIUS])
        patch = patch_at(green, (*first[:2], TOPS[rank]), PATCH)
        force = solve_with_patches(body, [patch], own[-1] - anchor)[1][0]
        assert force[2] < 0, "the tool would have let go"
        return self.bodies[rank].vectors_to_scene(force)


END = np.array([0.0015, 0.0006, -0.0018])


def test_the_orientation_is_a_general_one():
    assert np.linalg.norm(TURNED) == pytest.approx(1, abs=1e-15)
    normal = rotated(UP, TURNED)
    assert np.abs(normal).min() > 0.1 and normal @ END < -5e-4
    assert np.abs(rotated(normal, conjugate(TURNED)) - UP).max() < 1e-15


def test_one_tool_on_two_bodies_feels_the_sum_of_two_solves(blocks):
    placed = Placed(blocks)
    path = placed.path(END)
    played = placed.simulation.play(path, watch=[(i, n) for i, (_, g) in enumerate(blocks) for n in g.surface_nodes])
    forces = np.array([placed.expected(rank, path) for rank in (0, 1)])
    assert np.linalg.norm(forces, axis=1).min() > 0.1
    assert np.abs(played.forces[-1] + forces.sum(axis=0)).max() <= 1e-9 * np.abs(forces).max()
    # Displacements are those of each body in its own frame.
    surfaces = np.split(played.displacements[-1], [len(blocks[0][1].surface_nodes)])
    assert all(np.abs(surface).max() > 1e-3 for surface in surfaces)


def test_contacts_of_a_running_loop_are_in_the_world(blocks):
    placed = Placed(blocks, shift=(0.2, -0.3, 0.1), turn=unit(0.9, -0.2, 0.3, 0.4))
    path = placed.path(END)
    with placed.simulation as simulation:
        simulation.move(path[0])
        settle(simulation)
        simulation.move(path[-1])
        frame = settle(simulation, lambda frame: len(frame.contacts) == 2)
    assert [(contact.tool, contact.body) for contact in frame.contacts] == [(0, 0), (0, 1)]
    total = np.zeros(3)
    for contact, built, (body, green) in zip(frame.contacts, placed.bodies, blocks, strict=True):
        own = built.points_to_body(contact.displacement) - built.points_to_body(np.zeros(3))
        displacements, force = solve_with_patches(body, [(contact.nodes, contact.weights)], own)
        assert np.abs(contact.force - built.vectors_to_scene(force[0])).max() <= 1e-9 * np.abs(force).max()
        surface = displacements[green.surface_nodes]
        assert np.abs(frame.bodies[contact.body].displacements - surface).max() <= 1e-9 * np.abs(surface).max()
        # The point lies on the body's top, its normal points out of it, and the anchor is a radius above.
        place = built.points_to_body(contact.point)
        assert place[2] == pytest.approx(TOPS[contact.body], abs=1e-12)
        assert contact.normal == pytest.approx(built.vectors_to_scene(np.array(UP)), abs=1e-12)
        # What the page draws is the place in the frame of the body, which the tick has found.
        assert contact._own_point == pytest.approx(place, abs=1e-12) and contact._own_normal == pytest.approx(
            UP, abs=1e-12
        )
        assert contact.anchor == pytest.approx(contact.point + RADIUS * contact.normal, abs=1e-12)
        total += contact.force
    assert frame.forces[0] == pytest.approx(-total, rel=1e-12)


def test_two_tools_on_two_bodies(blocks):
    """The first tool touches both bodies, the second only the second one, whose solve has both constraints."""
    placed = Placed(blocks, tools=2)
    first = placed.path(END)
    own = BESIDE + np.outer(np.linspace(-2e-4, 2.2e-3, len(first)), -UP) + RADIUS * UP
    second = placed.bodies[1].points_to_scene(own)
    assert (placed.bodies[0].points_to_body(second)[:, 2] > TOPS[0] + RADIUS).all(), "it must not touch the first body"
    forces = placed.simulation.play(np.stack([first, second], axis=1)).forces[-1]
    (body, green), built = blocks[1], placed.bodies[1]
    track = built.points_to_body(first)
    landed = track[int(np.argmax(track[:, 2] < TOPS[1] + RADIUS))]
    anchor = np.array([*landed[:2], TOPS[1] + RADIUS])
    patches = [patch_at(green, (*landed[:2], TOPS[1]), PATCH), patch_at(green, BESIDE, PATCH)]
    presses = np.array([track[-1] - anchor, -2.2e-3 * UP])
    on_second = built.vectors_to_scene(solve_with_patches(body, patches, presses)[1])
    expected = np.array([placed.expected(0, first) + on_second[0], on_second[1]])
    assert np.abs(forces + expected).max() <= 1e-9 * np.abs(expected).max()
    alone = placed.simulation.play(np.stack([first, np.full_like(second, np.nan)], axis=1)).forces[-1, 0]
    assert np.linalg.norm(forces[0] - alone) > 0.01 * np.linalg.norm(alone)


def test_moving_and_turning_the_whole_scene_turns_the_forces(blocks):
    turn = unit(-0.4, 0.7, 0.2, -0.5)
    here, there = Placed(blocks), Placed(blocks, shift=(0.07, -0.11, 0.04), turn=turn)
    forces = here.simulation.run(here.path(END))
    moved = there.simulation.run(there.path(END))
    assert np.abs(forces).max() > 0.1
    assert np.abs(moved - rotated(forces, turn)).max() <= 1e-12 * np.abs(forces).max()


SCENE = """
[[body]]
name = "still"
mesh = "still.vtu"
precision = "f64"

[[body]]
name = "moving"
mesh = "moving.vtu"
precision = "f64"
position = ["120mm", 0, 0]
orientation = [0.6, 0, 0, 0.8]

[body.dynamics]
modes = 20
coupling = 400

[supports]
fixed = "z < 1e-6"

[material]
youngs_modulus = "20kPa"
poissons_ratio = 0.4

[[tool]]
radius = "6mm"
contact_radius = "8mm"

[[tool]]
radius = "5mm"
contact_radius = "7mm"

[view]
strain_limit = 0

[device]
max_force = 100
max_slew = 1e9
ramp = 0
"""


def test_one_body_moves_and_the_other_rests(tmp_path):
    """Each is what it would be in a scene of its own, to the last bit."""
    box_mesh((5, 4, 4)).write(tmp_path / "still.vtu")
    box_mesh((4, 3, 3), size=(0.05, 0.05, 0.06)).write(tmp_path / "moving.vtu")
    (tmp_path / "both.toml").write_text(SCENE)
    start = SCENE.index("[[body]]", 10)
    (tmp_path / "still.toml").write_text(
        SCENE[: SCENE.index("[[body]]")] + SCENE[1:start] + SCENE[SCENE.index("[supports]") :]
    )
    (tmp_path / "moving.toml").write_text(SCENE[start:])
    both, still, moving = (
        palpate.Simulation(palpate.Scene.read(tmp_path / f"{n}.toml")) for n in ("both", "still", "moving")
    )
    assert [body.motion is not None for body in both.bodies] == [False, True]
    ticks = 300
    depths = 0.003 * np.sin(np.linspace(0, np.pi, ticks)) - 1e-4
    first = [0.041, 0.026, 0.05] + np.outer(0.006 - depths, UP)
    second = both.bodies[1].points_to_scene([0.026, 0.023, 0.06] + np.outer(0.005 - depths, UP))
    path = np.stack([first, second], axis=1)
    watch = [(i, int(n)) for i, body in enumerate(both.bodies) for n in body.green.surface_nodes[::5]]
    nothing = np.full_like(first, np.nan)
    played = both.play(path, watch=watch)
    assert np.abs(played.forces).max(axis=(0, 2)).min() > 0.1
    assert played.energies[0] is None and played.energies[1].total.max() > 1e-5
    assert played.energy is played.energies[1]
    at_rest = still.play(np.stack([first, nothing], axis=1), watch=[n for i, n in watch if i == 0])
    in_motion = moving.play(np.stack([nothing, second], axis=1), watch=[n for i, n in watch if i == 1])
    assert np.array_equal(played.forces[:, 0], at_rest.forces[:, 0])
    assert np.array_equal(played.forces[:, 1], in_motion.forces[:, 1])
    count = at_rest.displacements.shape[1]
    assert np.array_equal(played.displacements[:, :count], at_rest.displacements)
    assert np.array_equal(played.displacements[:, count:], in_motion.displacements)
    # After the press the body at rest is back at once, the other swings on.
    assert np.abs(played.displacements[-1, :count]).max() == 0 < np.abs(played.displacements[-1, count:]).max()
    # A strike is for the body that moves.
    struck = both.play(
        np.full((50, 2, 3), np.nan),
        strikes=[(0, both.bodies[1].points_to_scene([0.02, 0.02, 0.06]), (0, 0, -1e-3))],
        watch=watch,
    )
    assert np.abs(struck.displacements[:, :count]).max() == 0 < struck.energy.total[-1]
