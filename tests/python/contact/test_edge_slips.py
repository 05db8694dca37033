"""A sphere carried deep over a sharp edge: in the loop and in a full finite strain solution the edge slips past it."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.benchmark import quiet_body
from palpate.validation.verify.contact.loop import UNLIMITED
from palpate.validation.verify.contact.measures import given_out
from palpate.validation.verify.grids import lattice, mapped

SIZE, CELL, RADIUS, STEP = (0.08, 0.05, 0.05), 5e-3, 6e-3, 20e-6
# Where the sphere is pressed down, from the edge, m.
INSIDE = 0.010
# By depth over the radius: places of the centre beyond the edge, m, and forces outwards and up there, N; between which
# places the edge slips, m; and what the hand loses, over the most that it has put in. `python -m benches strain --edge`
# solved them; the full solution stands in `benches/strain/edge_forces.json`.
FULL = {
    1.0: (
        [-6.12e-3, -3.21e-3, 1.16e-3, 3.10e-3],
        [[0.041, 0.414], [0.061, 0.361], [0.171, 0.049], [0.082, 0.019]],
        [0.7e-3, 1.2e-3],
        0.142,
    ),
    1.5: (
        [-6e-3, -4e-3, 0.0, 3e-3],
        [[0.103, 0.706], [0.132, 0.651], [0.291, 0.047], [0.115, 0.011]],
        [-1.0e-3, -0.5e-3],
        0.315,
    ),
}
# Largest difference of a force, over the largest of these; of the place at which the edge slips, over the radius; of
# what is lost.
TOLERANCE, PLACE, LOSS = 0.035, 0.4, 0.1


@pytest.fixture(scope="module")
def simulation(tmp_path_factory) -> palpate.Simulation:
    axes = [np.linspace(0.0, size, round(size / CELL) + 1) for size in SIZE]
    mesh = mapped(lattice(*axes), quadratic=True)
    body = quiet_body(mesh, palpate.Material(10e3, 0.45, law="neo-hookean"), mesh.nodes[:, 2] < 1e-9)
    edge = np.array([SIZE[0], SIZE[2]])
    near = np.linalg.norm(mesh.nodes[mesh.surface_nodes][:, [0, 2]] - edge, axis=1) < 0.035
    path = tmp_path_factory.mktemp("edge") / "block.palpate"
    green = palpate.precompute(body, touch=mesh.surface_nodes[near], precision="f32", path=path, progress=False)
    tool = {"radius": RADIUS, "friction": 0.0}
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=tool, device=UNLIMITED, view={"strain_limit": 0})
    return palpate.Simulation(BuiltScene.of(scene, body, green))


@pytest.fixture(scope="module", params=FULL)
def carried(request, simulation) -> tuple[float, np.ndarray, np.ndarray]:
    """Depth over the radius, path and forces: down beside the edge, and out at that height until the sphere is free."""
    height = SIZE[2] + RADIUS - request.param * RADIUS
    down = np.arange(SIZE[2] + RADIUS, height, -STEP)
    out = np.arange(-INSIDE, RADIUS + 1e-3, STEP)
    places = [(-INSIDE, z) for z in down] + [(x, height) for x in out]
    path = np.array([(SIZE[0] + x, SIZE[1] / 2, z) for x, z in places])
    with pytest.warns(palpate.TouchWarning):
        recording = simulation.play(path, np.tile([1.0, 0.0, 0.0, 0.0], (len(path), 1)))
    return request.param, path, recording.computed_forces


def differences(depth: float, path: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Differences of the forces at the places of the full solution, over its largest."""
    places, full, _, _ = FULL[depth]
    out = path[:, 2] < path[:, 2].min() + 1e-9
    found = forces[out][np.searchsorted(path[out, 0], SIZE[0] + np.array(places) - 1e-9)]
    return np.linalg.norm(found[:, [0, 2]] - full, axis=1) / np.linalg.norm(full, axis=1).max()


def test_forces_are_those_of_the_full_solution(carried):
    assert differences(*carried).max() <= TOLERANCE, differences(*carried)


def test_the_edge_slips_where_it_does_in_the_full_solution(carried):
    depth, path, forces = carried
    first, last = FULL[depth][2]
    changes = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    place = path[int(np.argmax(changes)) + 1, 0] - SIZE[0]
    assert first - PLACE * RADIUS <= place <= last + PLACE * RADIUS, place


def test_the_hand_loses_as_much_as_in_the_full_solution(carried):
    depth, path, forces = carried
    given, peak = given_out(path[None], forces[None])
    assert -given[0] / peak[0] == pytest.approx(FULL[depth][3], abs=LOSS)


def test_wrong_forces_are_seen(carried):
    """Falsified: 5 % off, of the wrong sign outwards, and as before the edge slips."""
    depth, path, forces = carried
    wrong = {
        "too high": 1.05 * forces,
        "outwards is inwards": forces * [-1.0, 1.0, 1.0],
        "no slip": np.where((path[:, 0] > SIZE[0] - 4e-3)[:, None], forces[path[:, 0] < SIZE[0] - 4e-3][-1], forces),
    }
    for name, falsified in wrong.items():
        assert differences(depth, path, falsified).max() > TOLERANCE, name
