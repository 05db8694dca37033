"""A sphere on the sharp edge of a block and carried over it, beside a direct solution of a fine mesh."""

from __future__ import annotations

import edge_block
import numpy as np
import pytest
from edge_block import Region
from scipy.spatial.transform import Rotation

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.contact.loop import UNLIMITED
from palpate.validation.verify.contact.measures import given_out

RADIUS, ELEMENT, STEP = 6e-3, 6e-3, 10e-6
DEPTHS = np.array([1e-3, 2e-3, 3e-3])
UP = np.array([0.0, 0.0, 1.0])
OUT = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
# Forces up, N, of presses straight down at these distances from the edge, m, negative over the top, and of one along
# the diagonal; as `solved_directly` finds them.
DOWN = {
    -5e-3: (32.9e-3, 85.8e-3, 148.1e-3),
    -3e-3: (28.9e-3, 75.7e-3, 132.0e-3),
    -1e-3: (22.4e-3, 61.4e-3, 109.8e-3),
    0.0: (17.9e-3, 52.0e-3, 95.4e-3),
    1.5e-3: (13.0e-3, 39.6e-3, 70.2e-3),
    3e-3: (9.7e-3, 24.3e-3, 34.9e-3),
}
DIAGONAL = (16.1e-3, 45.1e-3, 85.5e-3)
# Forces outwards and up, N, of a sphere that is carried over the edge 3 mm deep, at these places, m.
PLACES = 1e-3 * np.arange(-6, 7)
CARRIED = 1e-3 * np.array(
    [
        [9.0, 154.4],
        [8.3, 147.9],
        [9.9, 140.5],
        [12.1, 131.7],
        [14.8, 121.6],
        [18.0, 109.7],
        [22.1, 95.4],
        [27.6, 76.9],
        [29.4, 53.7],
        [25.6, 26.5],
        [12.6, 8.6],
        [0.4, 0.2],
        [0.0, 0.0],
    ]
)
# Largest difference: of a press relative to it, of a carried sphere over the largest force.
TOLERANCE, CARRIED_TOLERANCE = 0.13, 0.09


def start_above(place: float) -> np.ndarray:
    """Centre of a sphere that touches the edge or the top."""
    return np.array([place, 0.0, np.sqrt(RADIUS**2 - max(place, 0.0) ** 2)])


def solved_directly(starts: list[np.ndarray], way: np.ndarray, element: float) -> np.ndarray:
    contact = edge_block.direct_contact(0.0, Region(11e-3, 9e-3, 6.5e-3, element))
    places = [start - DEPTHS[:, None] * way for start in starts]
    return np.array([contact.press(edge_block.sphere(RADIUS), each, Rotation.identity(), rounds=40) for each in places])


@pytest.fixture(scope="module")
def simulation(tmp_path_factory) -> palpate.Simulation:
    body = edge_block.body_of(edge_block.whole_block(0.0, ELEMENT), half=False)
    green = palpate.precompute(body, precision="f32", path=tmp_path_factory.mktemp("edge") / "block.palpate")
    tool = {"radius": RADIUS, "friction": 0.0}
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=tool, device=UNLIMITED, view={"strain_limit": 0})
    return palpate.Simulation(BuiltScene.of(scene, body, green))


def forces_at(simulation: palpate.Simulation, path: np.ndarray) -> np.ndarray:
    return simulation.play(path, np.tile([1.0, 0.0, 0.0, 0.0], (len(path), 1))).computed_forces


def pressed(simulation: palpate.Simulation, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Forces along the way, N, at the depths."""
    down = np.arange(-1e-3, DEPTHS[-1] + STEP / 2, STEP)
    forces = forces_at(simulation, start - down[:, None] * way)
    return forces[np.searchsorted(down, DEPTHS - STEP / 2)] @ way


def carried(simulation: palpate.Simulation) -> np.ndarray:
    """Forces outwards and up, N, at the places."""
    first = np.array([PLACES[0], 0.0, RADIUS - DEPTHS[-1]])
    down = first + np.linspace(DEPTHS[-1] + 1e-3, 0.0, 400)[:, None] * UP
    along = np.arange(0.0, PLACES[-1] - PLACES[0] + STEP, 2 * STEP)
    over = first + along[:, None] * [1.0, 0.0, 0.0]
    forces = forces_at(simulation, np.vstack([down, over]))[len(down) :]
    return forces[np.searchsorted(along, PLACES - PLACES[0] - STEP)][:, [0, 2]]


def within(forces: np.ndarray, direct: np.ndarray) -> np.ndarray:
    return np.abs(forces / direct - 1) <= TOLERANCE


def follows(forces: np.ndarray) -> bool:
    off = np.linalg.norm(forces - CARRIED, axis=1)
    return bool((off <= CARRIED_TOLERANCE * np.linalg.norm(CARRIED, axis=1).max()).all())


@pytest.mark.parametrize("place", DOWN)
def test_a_sphere_pressed_down_beside_an_edge_feels_what_the_direct_solution_does(simulation, place):
    forces, direct = pressed(simulation, start_above(place), UP), np.array(DOWN[place])
    assert within(forces, direct).all(), np.round(100 * (forces / direct - 1), 1)


def test_a_sphere_pressed_on_an_edge_feels_what_the_direct_solution_does(simulation):
    forces, direct = pressed(simulation, RADIUS * OUT, OUT), np.array(DIAGONAL)
    assert within(forces, direct).all(), np.round(100 * (forces / direct - 1), 1)


def test_a_sphere_carried_over_an_edge_feels_what_the_direct_solution_does(simulation):
    forces = carried(simulation)
    assert follows(forces), np.round(1e3 * (forces - CARRIED), 1)


def test_wrong_forces_are_not_within_the_tolerance():
    for direct in map(np.array, [*DOWN.values(), DIAGONAL]):
        assert not within((1.01 + TOLERANCE) * direct, direct).any()
        assert not within((0.99 - TOLERANCE) * direct, direct).any()
        assert not within(-direct, direct).any()
    assert follows(CARRIED)
    assert not follows(1.1 * CARRIED)
    assert not follows(-CARRIED)
    assert not follows(CARRIED * [-1.0, 1.0])
    # A contact that is lost over the edge, and one that is late by a place.
    assert not follows(np.where(PLACES[:, None] > 0.5e-3, 0.0, CARRIED))
    assert not follows(np.vstack([CARRIED[:1], CARRIED[:-1]]))


@pytest.mark.slow
def test_the_direct_solution_is_that_of_the_tables():
    starts, known = [start_above(place) for place in DOWN], np.array(list(DOWN.values()))
    assert np.abs(solved_directly(starts, UP, 1.1e-3) @ UP / known - 1).max() < 0.01
    diagonal = solved_directly([RADIUS * OUT], OUT, 1.1e-3)[0] @ OUT
    assert np.abs(diagonal / np.array(DIAGONAL) - 1).max() < 0.01
    # Its elements matter little.
    finer = solved_directly(starts, UP, 1.3e-3) @ UP
    assert np.abs(finer / known - 1).max() < 0.05


@pytest.mark.slow
def test_the_direct_solution_loses_energy_over_the_edge_by_its_steps():
    """Pressed one radius deep on the top, and carried over the edge until nothing touches, as in docs/accuracy.md."""
    radius = 3e-3
    contact = edge_block.direct_contact(0.0, Region(4 * radius, 3.2 * radius, 2.4 * radius, 0.9e-3))
    lost = {}
    for steps in (20, 40):
        first, down = np.array([-2 * radius, 0.0, radius]), np.linspace(0, radius, steps + 1)
        along = np.linspace(0, 3.2 * radius, int(3.2 * steps) + 1)[1:]
        path = np.vstack([first - down[:, None] * UP, first - radius * UP + along[:, None] * [1.0, 0.0, 0.0]])
        forces = contact.press(edge_block.sphere(radius), path, Rotation.identity(), rounds=60)
        given, peak = given_out(path[None], forces[None])
        lost[steps] = -given[0] / peak[0]
    assert 0.14 < lost[20] < 0.21 and 0.08 < lost[40] < 0.8 * lost[20], lost
