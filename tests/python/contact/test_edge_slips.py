"""A sphere and a capsule carried deep over a sharp edge: in the loop and in full solutions the edge slips past them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.benchmark import quiet_body
from palpate.validation.verify.contact.loop import UNLIMITED
from palpate.validation.verify.contact.measures import given_out
from palpate.validation.verify.grids import lattice, mapped

SIZE, CELL, STEP = (0.08, 0.05, 0.05), 5e-3, 20e-6


@dataclass(frozen=True)
class FullSolution:
    """A tool carried over the edge by `python -m benches strain --edge`; stored in `benches/strain/edge_forces.json`.

    Attributes
    ----------
    radius, length
        Of the tool, m; of the segment around which it lies, across the edge, zero for a sphere.
    depth
        How deep it is pressed, over its radius.
    inside
        Where it is pressed down, from the edge, m.
    places
        Of its middle beyond the edge, m.
    forces
        Outwards and up there, N.
    slip
        Between which places the edge slips, m.
    lost
        What the hand loses, over the most that it has put in.
    off
        A wrong factor of the loop's force, farther from the full solution.

    """

    radius: float
    length: float
    depth: float
    inside: float
    places: list[float]
    forces: list[list[float]]
    slip: list[float]
    lost: float
    off: float

    @property
    def tool(self) -> dict[str, Any]:
        """Of a scene."""
        shape = {"shape": "capsule", "length": self.length} if self.length else {}
        return {**shape, "radius": self.radius, "friction": 0.0}

    @property
    def path(self) -> np.ndarray:
        """Places of its middle (t, 3), m: down beside the edge, and out at that height until it is free."""
        height = SIZE[2] + self.radius - self.depth * self.radius
        down = np.arange(SIZE[2] + self.radius, height, -STEP)
        out = np.arange(-self.inside, 0.5 * self.length + self.radius + 1e-3, STEP)
        places = [(-self.inside, z) for z in down] + [(x, height) for x in out]
        return np.array([(SIZE[0] + x, SIZE[1] / 2, z) for x, z in places])


FULL = {
    "sphere, 1 R": FullSolution(
        radius=6e-3,
        length=0.0,
        depth=1.0,
        inside=0.010,
        places=[-6.12e-3, -3.21e-3, 1.16e-3, 3.10e-3],
        forces=[[0.041, 0.414], [0.061, 0.361], [0.171, 0.049], [0.082, 0.019]],
        slip=[0.7e-3, 1.2e-3],
        lost=0.142,
        off=1.05,
    ),
    "sphere, 1.5 R": FullSolution(
        radius=6e-3,
        length=0.0,
        depth=1.5,
        inside=0.010,
        places=[-6e-3, -4e-3, 0.0, 3e-3],
        forces=[[0.103, 0.706], [0.132, 0.651], [0.291, 0.047], [0.115, 0.011]],
        slip=[-1.0e-3, -0.5e-3],
        lost=0.315,
        off=1.05,
    ),
    "capsule, 1.5 R": FullSolution(
        radius=3e-3,
        length=0.018,
        depth=1.5,
        inside=0.015,
        places=[-8e-3, -5.5e-3, 2.5e-3, 10e-3],
        forces=[[0.045, 0.484], [0.045, 0.431], [0.044, 0.265], [0.047, 0.006]],
        slip=[8.5e-3, 9.0e-3],
        lost=0.061,
        off=0.95,
    ),
}
# Largest difference of a force, over the largest of these; of the place at which the edge slips, over the radius; of
# what is lost.
TOLERANCE, PLACE, LOSS = 0.035, 0.4, 0.1


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> tuple[palpate.Body, palpate.GreensFunction]:
    axes = [np.linspace(0.0, size, round(size / CELL) + 1) for size in SIZE]
    mesh = mapped(lattice(*axes), quadratic=True)
    body = quiet_body(mesh, palpate.Material(10e3, 0.45, law="neo-hookean"), mesh.nodes[:, 2] < 1e-9)
    edge = np.array([SIZE[0], SIZE[2]])
    near = np.linalg.norm(mesh.nodes[mesh.surface_nodes][:, [0, 2]] - edge, axis=1) < 0.035
    path = tmp_path_factory.mktemp("edge") / "block.palpate"
    return body, palpate.precompute(body, touch=mesh.surface_nodes[near], precision="f32", path=path, progress=False)


@pytest.fixture(scope="module", params=FULL)
def carried(request, block) -> tuple[FullSolution, np.ndarray]:
    """Forces of the loop over the same path."""
    full = FULL[request.param]
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=full.tool, device=UNLIMITED, view={"strain_limit": 0})
    # A capsule's own axis is z, and its origin is at an end of the segment.
    turn = np.sqrt([0.5, 0.0, 0.5, 0.0]) if full.length else [1.0, 0.0, 0.0, 0.0]
    path = full.path
    simulation = palpate.Simulation(BuiltScene.of(scene, *block))
    with pytest.warns(palpate.TouchWarning):
        recording = simulation.play(path - [0.5 * full.length, 0.0, 0.0], np.tile(turn, (len(path), 1)))
    return full, recording.computed_forces.reshape(-1, 3)


def differences(full: FullSolution, forces: np.ndarray) -> np.ndarray:
    """Differences of the forces at the places of the full solution, over its largest."""
    path = full.path
    out = path[:, 2] < path[:, 2].min() + 1e-9
    found = forces[out][np.searchsorted(path[out, 0], SIZE[0] + np.array(full.places) - 1e-9)]
    return np.linalg.norm(found[:, [0, 2]] - full.forces, axis=1) / np.linalg.norm(full.forces, axis=1).max()


def test_forces_are_those_of_the_full_solution(carried):
    assert differences(*carried).max() <= TOLERANCE, differences(*carried)


def test_the_edge_slips_where_it_does_in_the_full_solution(carried):
    full, forces = carried
    first, last = full.slip
    changes = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    place = full.path[int(np.argmax(changes)) + 1, 0] - SIZE[0]
    assert first - PLACE * full.radius <= place <= last + PLACE * full.radius, place


def test_the_hand_loses_as_much_as_in_the_full_solution(carried):
    full, forces = carried
    given, peak = given_out(full.path[None], forces[None])
    assert -given[0] / peak[0] == pytest.approx(full.lost, abs=LOSS)


def test_wrong_forces_are_seen(carried):
    """Falsified: 5 % off, of the wrong sign outwards, and as before the edge slips."""
    full, forces = carried
    x = full.path[:, 0]
    held = SIZE[0] + full.slip[0] - 3e-3
    wrong = {
        "5 % off": full.off * forces,
        "outwards is inwards": forces * [-1.0, 1.0, 1.0],
        "no slip": np.where((x > held)[:, None], forces[x < held][-1], forces),
    }
    for name, falsified in wrong.items():
        assert differences(full, falsified).max() > TOLERANCE, name
