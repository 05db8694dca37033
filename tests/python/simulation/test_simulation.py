"""The force loop: statics, contact law, safety and determinism as a user meets them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from conftest import box_mesh
from running import settle

import palpate

TOP = np.array([0.041, 0.026, 0.05])
RADIUS, PATCH = 0.006, 0.012


@pytest.fixture
def scene(tmp_path):
    mesh = box_mesh(cells=(8, 5, 5), jitter=0.1)
    mesh.write(tmp_path / "block.vtu")
    (tmp_path / "block.toml").write_text(
        f"""
[body]
mesh = "block.vtu"
precision = "f64"
[material]
youngs_modulus = "10kPa"
poissons_ratio = 0.4
[supports]
fixed = "z < 1e-6"
[tool]
radius = {RADIUS}
contact_radius = "{PATCH * 1e3}mm"
[device]
max_force = 100
max_slew = 1e9
ramp = 0
[view]
strain_limit = 0
"""
    )
    return palpate.Scene.read(tmp_path / "block.toml")


def along(*points, ticks=200):
    """Positions of the tool's centre over the surface point TOP + offset, tool radius included."""
    points = [TOP + [0, 0, RADIUS] + np.array(p) for p in points]
    legs = [np.linspace(a, b, ticks, endpoint=False) for a, b in itertools.pairwise(points)]
    return np.vstack([*legs, points[-1]])


def test_force_on_the_device_is_minus_the_capacitance_answer(scene):
    simulation = palpate.Simulation(scene)
    positions = along((0, 0, 0.002), (0, 0, -0.003), (0.002, -0.001, -0.003))
    forces = simulation.run(positions)
    first = int(np.argmax(positions[:, 2] < TOP[2] + RADIUS))
    assert np.abs(forces[:first]).max() == 0
    assert (forces[first:, 2] > 0).all()
    touch = simulation.green.touch(point=TOP, displacement=(0.002, -0.001, -0.003), radius=PATCH)
    assert forces[-1] == pytest.approx(-touch.force, rel=1e-9)


def test_sticking_contact_does_no_net_work_over_a_closed_path(scene):
    path = along((0, 0, -0.001), (0.003, 0, -0.004), (0.001, 0.003, -0.005), (-0.002, 0, -0.002), (0, 0, -0.001))
    start = along((0, 0, 0.001), (0, 0, -0.001))
    forces = palpate.Simulation(scene).run(np.vstack([start, path]))[len(start) :]
    # A linear spring: the trapezoidal rule is exact on straight legs.
    work = np.einsum("ij,ij->i", (forces[1:] + forces[:-1]) / 2, np.diff(path, axis=0))
    assert np.abs(work).sum() > 1e-4
    assert abs(work.sum()) <= 1e-9 * np.abs(work).sum()


def test_a_press_never_pulls_and_a_new_one_starts_from_zero(scene):
    positions = along((0, 0, 0.002), (0, 0, -0.003), (0.006, 0, -0.002), (0.006, 0, 0.004), (0, 0, -0.002))
    forces = palpate.Simulation(scene).run(positions)
    assert forces[:, 2].min() >= 0
    # Letting go may drop a sideways force at once; nothing may ever rise at once.
    size = np.linalg.norm(forces, axis=1)
    assert np.diff(size).max() < 0.05 * size.max()


def test_grab_holds_in_both_directions(scene):
    with palpate.Simulation(scene) as simulation:
        simulation.move(TOP + [0, 0, RADIUS])
        simulation.grab(True)
        settle(simulation)
        simulation.move(TOP + [0, 0, RADIUS + 0.003])
        frame = settle(simulation, lambda f: f.contacts and abs(f.forces[0, 2]) > 0)
        assert frame.contacts[0].mode == "grab"
        assert frame.forces[0, 2] < 0
        simulation.grab(False)
        assert np.abs(settle(simulation, lambda f: not f.contacts).forces).max() == 0


def test_running_loop_agrees_with_the_offline_answer_and_scales_with_stiffness(scene):
    with palpate.Simulation(scene) as simulation:
        simulation.move(TOP + [0, 0, RADIUS + 0.002])
        settle(simulation)
        simulation.move(TOP + [0, 0, RADIUS - 0.003])
        frame = settle(simulation, lambda f: len(f.contacts) == 1)
        contact = frame.contacts[0]
        touch = simulation.green.touch(point=contact.point, displacement=(0, 0, -0.003), radius=PATCH)
        assert frame.forces[0] == pytest.approx(-touch.force, rel=1e-4)
        assert frame.displacements == pytest.approx(touch.displacements, abs=1e-4 * 0.003)
        assert contact.weights.sum() == pytest.approx(1, abs=1e-12)
        simulation.set_youngs_modulus(20e3)
        stiffer = settle(simulation, lambda f: f.forces[0, 2] > 1.5 * frame.forces[0, 2])
        assert stiffer.forces[0] == pytest.approx(2 * frame.forces[0], rel=1e-6)
        assert stiffer.displacements == pytest.approx(frame.displacements, abs=1e-9)
        statistics = stiffer.statistics
        assert statistics["fault"] is None
        assert statistics["ticks"] > 100
        assert 0 < statistics["compute_us"]["p50"] <= statistics["compute_us"]["max"]
        log = simulation.drain_log()
        assert np.diff(log["time"]).min() > 0.9e-3
        simulation.remove()
        assert np.abs(settle(simulation, lambda f: not f.contacts).forces).max() == 0


def test_same_path_same_bits(scene):
    path = along((0, 0, 0.002), (0.001, 0, -0.003), (0, 0.001, 0.001))
    assert palpate.Simulation(scene).run(path).tobytes() == palpate.Simulation(scene).run(path).tobytes()


def test_device_limits_hold(tmp_path, scene):
    text = (tmp_path / "block.toml").read_text()
    limits = "[view]\nstrain_limit = 0\n[device]\nmax_force = 0.3\nmax_slew = 5\nramp = 0.1\n"
    (tmp_path / "tame.toml").write_text(text[: text.index("[device]")] + limits)
    path = along((0, 0, 0.001), (0, 0, -0.004), ticks=400)
    free = palpate.Simulation(scene).run(path)
    tame = palpate.Simulation(palpate.Scene.read(tmp_path / "tame.toml")).run(path)
    size, computed = np.linalg.norm(tame, axis=1), np.linalg.norm(free, axis=1)
    assert computed.max() > 0.4
    assert size.max() == pytest.approx(0.3, rel=1e-12)
    assert np.diff(size).max() <= 5e-3 * (1 + 1e-9)
    assert (size <= computed * (1 + 1e-12)).all()


@pytest.mark.parametrize("bad", [np.zeros((3, 2)), [[0, 0, np.nan]], np.zeros(3)])
def test_bad_paths_are_refused(scene, bad):
    with pytest.raises(palpate.Error):
        palpate.Simulation(scene).run(np.array(bad))


def test_contact_radius_that_covers_too_much_is_refused(scene):
    fine = box_mesh(cells=(20, 14, 14), jitter=0)
    body = palpate.Body(fine, material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9)
    # In the middle of the top, where a disc of this radius covers most of it.
    away = np.linalg.norm(fine.nodes[fine.surface_nodes] - [0.04, 0.025, 0.05], axis=1)
    green = palpate.precompute(body, touch=fine.surface_nodes[np.argsort(away)[:50]])
    from palpate.scene import BuiltScene

    simulation = palpate.Simulation(BuiltScene.of(scene, body, green))
    with pytest.raises(palpate.Error, match="limit is 256"):
        simulation.set_radius(0.05)
