"""Two tools on one body: each feels the dent of the other, as one finite element solve with both constraints says."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh
from direct import patch_at, solve_with_patches
from running import settle

import palpate
from palpate.scene import BuiltScene

RADII, PATCHES = (0.006, 0.004), (0.012, 0.008)
# On the top of the block, 80 x 50 x 50 mm.
POINTS = np.array([[0.031, 0.026, 0.05], [0.057, 0.021, 0.05]])
# Of the two tools, from where they touch, m.
PRESSES = np.array([[0.001, -0.0005, -0.003], [-0.0007, 0.0004, -0.002]])
UP = np.array([0.0, 0.0, 1.0])
# Nothing acts but the law of contact.
BARE = {"device": {"max_force": 1e3, "max_slew": 1e9, "ramp": 0, "max_stiffness": 1e9}, "view": {"strain_limit": 0}}


@pytest.fixture(scope="module")
def body() -> palpate.Body:
    return palpate.Body(box_mesh((7, 5, 4)), material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 2] < 1e-9)


@pytest.fixture(scope="module")
def green(body, tmp_path_factory) -> palpate.GreensFunction:
    return palpate.precompute(body, precision="f64", path=tmp_path_factory.mktemp("green") / "block.palpate")


@pytest.fixture
def simulation(body, green) -> palpate.Simulation:
    tools = [{"radius": r, "contact_radius": a} for r, a in zip(RADII, PATCHES, strict=True)]
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=tools, **BARE)
    return palpate.Simulation(BuiltScene.of(scene, body, green))


def centres(depths: np.ndarray, sideways: float = 0.0) -> np.ndarray:
    """Of both tools (2, 3) over their points at depths (2,), m, and a share of the presses' sideways parts."""
    return POINTS + (np.array(RADII) - depths)[:, None] * UP + sideways * PRESSES * (1 - UP)


def pressing(present=(True, True), ticks: int = 30, delays=(0, 0)) -> np.ndarray:
    """Path (t, 2, 3): down on the points, each tool so many ticks late, then sideways; NaN for a tool that is out."""
    steps = np.arange(1, ticks + max(delays) + 1)
    # From 0.1 mm above the surface.
    down = np.clip((steps[:, None] - delays) / ticks, 0.0, 1.0)
    depths = -1e-4 + down * (1e-4 - PRESSES[:, 2])
    landing = [centres(depth) for depth in depths]
    path = np.array(landing + [centres(-PRESSES[:, 2], share) for share in steps[:ticks] / ticks])
    path[:, ~np.array(present)] = np.nan
    return path


def test_forces_and_surface_are_those_of_one_solve_with_both_constraints(body, green, simulation):
    played = simulation.play(pressing(), watch=green.surface_nodes)
    patches = [patch_at(green, point, radius) for point, radius in zip(POINTS, PATCHES, strict=True)]
    displacements, forces = solve_with_patches(body, patches, PRESSES)
    assert np.abs(played.forces[-1] + forces).max() <= 1e-9 * np.abs(forces).max()
    surface = displacements[green.surface_nodes]
    assert np.abs(played.displacements[-1] - surface).max() <= 1e-9 * np.abs(surface).max()
    for (nodes, weights), press in zip(patches, PRESSES, strict=True):
        assert weights @ played.displacements[-1][np.searchsorted(green.surface_nodes, nodes)] == pytest.approx(press)


def test_the_second_finger_feels_the_dent_of_the_first(body, green, simulation):
    """In the dent of the first the second presses less deep, so it feels a smaller force than alone."""
    both = simulation.play(pressing()[:30]).forces[-1]
    for tool in (0, 1):
        alone = simulation.play(pressing(present=(tool == 0, tool == 1))[:30]).forces[-1]
        patch = patch_at(green, POINTS[tool], PATCHES[tool])
        expected = solve_with_patches(body, [patch], PRESSES[tool] * UP)[1][0]
        assert np.abs(alone[tool] + expected).max() <= 1e-9 * np.abs(expected).max()
        assert np.array_equal(alone[1 - tool], np.zeros(3))
        assert both[tool, 2] < 0.97 * alone[tool, 2]


def test_a_finger_that_rests_is_pushed_when_another_goes_on(simulation):
    """From the tenth tick on the first tool stands still; its force changes all the same."""
    path = pressing()[:30]
    path[10:, 0] = path[9, 0]
    standing = simulation.play(path).forces[9:, 0]
    assert np.linalg.norm(standing[-1] - standing[0]) > 0.05 * np.linalg.norm(standing[0])


@pytest.mark.parametrize("delays", [(0, 1), (0, 10), (0, 40), (40, 0)])
def test_a_finger_that_lands_in_the_dent_of_another_presses_as_deep_as_it_is(body, green, simulation, delays):
    """Whoever comes first, both are as deep in the end, and straight down: the answer is that of one solve."""
    path = pressing(delays=delays)[: 30 + max(delays)]
    forces = simulation.play(path).forces[-1]
    patches = [patch_at(green, point, radius) for point, radius in zip(POINTS, PATCHES, strict=True)]
    expected = solve_with_patches(body, patches, PRESSES * UP)[1]
    assert np.abs(forces + expected).max() <= 1e-9 * np.abs(expected).max()


def test_letting_go_leaves_the_other_alone(simulation):
    """After the second tool has left, the first feels what it would have felt without it."""
    path = np.concatenate([pressing(), pressing()[::-1]])
    path[len(path) // 2 :, 0] = path[len(path) // 2 - 1, 0]
    forces = simulation.play(path).forces
    alone = path.copy()
    alone[:, 1] = np.nan
    expected = simulation.play(alone).forces[-1, 0]
    assert np.array_equal(forces[-1, 1], np.zeros(3))
    assert forces[-1, 0] == pytest.approx(expected, rel=1e-12)


def test_one_holds_on_and_the_other_presses(body, green, simulation):
    """A grab pulls where a press lets go; the solve knows no difference."""
    path = pressing()
    path[:, 0] = POINTS[0] + RADII[0] * UP
    path[30:, 0] += np.linspace(0, 1, 30)[:, None] * [0.001, 0.0, 0.002]
    held = np.zeros(path.shape[:2], dtype=bool)
    held[:, 0] = True
    forces = simulation.play(path, grabs=held).forces[-1]
    patches = [patch_at(green, point, radius) for point, radius in zip(POINTS, PATCHES, strict=True)]
    expected = solve_with_patches(body, patches, np.array([[0.001, 0.0, 0.002], PRESSES[1]]))[1]
    assert expected[0, 2] > 0 > expected[1, 2]
    assert np.abs(forces + expected).max() <= 1e-9 * np.abs(expected).max()
    assert np.array_equal(simulation.play(path).forces[-1, 0], np.zeros(3))


def test_the_running_loop_has_both_contacts(body, green, simulation):
    presses = np.outer([0.003, 0.003], -UP)
    with simulation:
        for depth in (-0.002, 0.003):
            for tool, centre in enumerate(centres(np.full(2, depth))):
                simulation.move(centre, tool=tool)
            settle(simulation)
        frame = settle(simulation, lambda frame: len(frame.contacts) == 2)
    assert [contact.tool for contact in frame.contacts] == [0, 1]
    patches = [(contact.nodes, contact.weights) for contact in frame.contacts]
    moved = np.array([contact.displacement for contact in frame.contacts])
    assert moved == pytest.approx(presses, abs=1e-7)
    displacements, forces = solve_with_patches(body, patches, moved)
    assert np.abs([contact.force for contact in frame.contacts] - forces).max() <= 1e-9 * np.abs(forces).max()
    assert np.abs(frame.forces + forces).max() <= 1e-9 * np.abs(forces).max()
    surface = displacements[green.surface_nodes]
    assert np.abs(frame.displacements - surface).max() <= 1e-9 * np.abs(surface).max()


def test_wrong_scripts_are_refused_by_name(simulation):
    with pytest.raises(palpate.SceneError, match="positions of 3 tools, the scene has 2"):
        simulation.run(np.zeros((4, 3, 3)))
    with pytest.raises(palpate.SceneError, match=r"grabs must have shape \(4, 2\)"):
        simulation.play(np.zeros((4, 2, 3)), grabs=np.zeros((4, 3), dtype=bool))
    turned = np.zeros((4, 2, 4))
    turned[..., 0] = 1
    turned[2, 1] = [1, 1, 0, 0]
    with pytest.raises(palpate.SceneError, match="orientation of tool 1 at tick 2 is not a unit quaternion"):
        simulation.run(np.full((4, 2, 3), 0.5), turned)
    with pytest.raises(palpate.SceneError, match="there is no tool 2: the scene has 2"):
        simulation.move((0, 0, 0), tool=2)
