"""Contact beside peers played by known laws: its figures, its table, its plot, and which are missing."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import run_bench

from benches import contact, contact_peers
from benches.contact_numpy import contact_at
from palpate.validation.ticks import DEPTH, FRICTION, RADIUS, plate, press_centres
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.reference import Block, body_on_table


@pytest.fixture
def quick(monkeypatch):
    """Only two places and depths; MuJoCo is a spring of 100 N/m, Drake is not there."""

    def spring(mesh, material, radius, places, depths):
        assert mesh.tets.shape[1] == 4
        assert (len(mesh.nodes), np.ptp(mesh.nodes, axis=0).tolist()) == (726, [0.1, 0.1, 0.05])
        return 100.0 * np.tile(depths, (len(places), 1)), 0.01

    monkeypatch.setattr(contact, "DEPTHS", (5e-4, 1e-3))
    monkeypatch.setattr(contact, "PLACES", contact.PLACES[:2])
    monkeypatch.setattr(contact_peers, "installed", lambda: ["MuJoCo"])
    monkeypatch.setattr(contact_peers, "mujoco_forces", spring)


@pytest.mark.slow
def test_the_bench_puts_all_beside_the_direct_solution(quick, tmp_path):
    result = run_bench("contact", "--json", "--out", tmp_path)
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["missing"] == {"Drake": "drake"}
    ratios = {
        (row["method"], row["mesh"]): np.array(of) for row, of in zip(found["rows"], found["ratios"], strict=True)
    }
    assert np.abs(ratios["Palpate", contact.COARSE] - 1).max() < 0.07
    assert np.abs(ratios["Palpate", "10 nodes, 5 mm"] - 1).max() < 0.03
    assert (ratios[contact.AT_POINTS, contact.COARSE] > 2).all()  # 0.078 and 0.179 N and more, contact locks
    np.testing.assert_allclose(ratios["MuJoCo", contact.COARSE], 100 * np.array([5e-4, 1e-3]) / found["truth"])
    assert (tmp_path / "contact.png").read_bytes().startswith(b"\x89PNG")


def test_forces_of_a_peer_that_takes_forces_are_interpolated_at_depths(monkeypatch):
    depths = np.geomspace(1e-4, 1e-2, 7)
    monkeypatch.setattr(contact, "DEPTHS", (2.5e-4, 1e-3, 3e-3))
    found = contact._at_depths(depths[None] * [[1.0], [2.0]], 40.0 * depths**1.5)
    exact = 40.0 * np.array(contact.DEPTHS) ** 1.5
    np.testing.assert_allclose(found, [exact, exact / 2**1.5], rtol=1e-9)


@pytest.mark.slow
def test_the_contact_in_numpy_is_that_of_a_tick():
    """Of a sphere that presses and then slides; the parabola is 1 % stiffer, and sticks as a whole before it slides."""
    body, green = plate((14, 14, 6))
    middle = press_centres(body, [(0.0, 0.0)])[0]
    path = np.vstack([straight(middle + (0, 0, 2e-3), middle, 1e-4), straight(middle, middle + (5e-3, 0, 0), 1e-5)])
    forces = -loop_of(body, green, [sphere(RADIUS, FRICTION)]).run(path)
    own = contact_at(green, middle - (0, 0, RADIUS - DEPTH))
    found = np.array([own.tick(tool) for tool in path])
    assert np.abs(found - forces)[:, 2].max() < 0.03 * np.abs(forces[:, 2]).max()
    assert found[-1] == pytest.approx(forces[-1], abs=0.03 * abs(forces[-1, 2]))
    assert found[-1, 0] == pytest.approx(-FRICTION * found[-1, 2], rel=1e-9)


def check_peer(peer: str) -> None:
    """On large elements a peer's force is too large, or its depth too small."""
    block = Block()
    mesh, middle = body_on_table(block, (5, 5, 3), quadratic=False).mesh, np.array([[0.05, 0.05]])
    if peer == "MuJoCo":
        force = contact_peers.mujoco_forces(mesh, block.material, 0.01, middle, [1e-3])[0][0, 0]
        assert 0.0557 < force < 1.0
    else:
        depth = contact_peers.drake_depths(mesh, block.material, 0.01, middle, [0.0557])[0][0, 0]
        assert 0 < depth < 1e-3


# Peers are no dependency of the tests: where none is installed there is no test, rather than one that is skipped.
if contact_peers.installed():

    @pytest.mark.slow
    @pytest.mark.parametrize("peer", contact_peers.installed())
    def test_peers_press_too_hard(peer):
        check_peer(peer)
