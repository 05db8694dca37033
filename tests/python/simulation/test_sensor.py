"""A sensor of a robot simulator: the bits of a simulation, for any number of copies; frames, faults, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene

IDENTITY = (1.0, 0.0, 0.0, 0.0)
TURNED = (0.5, 0.5, -0.5, 0.5)


def scene_of(block, block_green, *tools, place=None, **tables) -> BuiltScene:
    table = {"store": "of a test", **({} if place is None else place)}
    view = tables.pop("view", {"strain_limit": 0})
    tools = list(tools) or [{"radius": 0.006}]
    return BuiltScene.of(palpate.Scene(body=table, tool=tools, view=view, **tables), block, block_green)


def paths(ticks: int, copies: int) -> np.ndarray:
    """(ticks, copies, 3): presses and slides, each elsewhere."""
    phase = np.linspace(0, 2 * np.pi, ticks)[:, None, None]
    start = np.array([0.03, 0.02, 0.0565]) + np.linspace(0, 0.02, copies)[:, None] * [1.0, 0.4, 0.0]
    return start - (1 - np.cos(phase)) * 0.0015 * np.array([-1.0, 0.3, 1.0])


def with_orientation(positions: np.ndarray, orientation=IDENTITY) -> np.ndarray:
    return np.concatenate([positions, np.broadcast_to(orientation, (*positions.shape[:-1], 4))], axis=-1)


def stepped(sensor: palpate.Sensor, poses: np.ndarray) -> np.ndarray:
    return np.array([sensor.step(row) for row in poses])


def test_copies_have_the_bits_of_single_simulations(block, block_green):
    scene = scene_of(block, block_green, device={"ramp": 0.02}, view={"strain_limit": 0.02})
    positions = paths(250, 5) - [0.0, 0.0, 0.004]
    wrenches = stepped(palpate.Sensor(scene, 5), with_orientation(positions))
    assert wrenches.shape == (250, 5, 1, 6)
    for copy in range(5):
        recording = palpate.Simulation(scene).play(positions[:, copy])
        assert np.array_equal(wrenches[:, copy, 0, :3], recording.forces)
        assert np.array_equal(wrenches[:, copy, 0, 3:], recording.torques)
    assert np.abs(wrenches[..., 2]).max() > 0.05 and recording.limited.any()


def test_of_two_tools_and_a_moving_body_too(block, block_green):
    tools = [{"radius": 0.006}, {"shape": "capsule", "radius": 0.005, "length": 0.01}]
    moving = palpate.Scene(
        body={"model": "beam"}, dynamics={"modes": 8}, tool=tools, view={"strain_limit": 0}, device={"ramp": 0}
    )
    motion = moving.dynamics.build(block, moving.device.max_stiffness, False)
    scene = BuiltScene.of(moving, block, block_green, motion)
    positions = paths(200, 2)
    turned = np.broadcast_to([IDENTITY, TURNED], (200, 2, 4))
    wrenches = stepped(palpate.Sensor(scene, 2), np.concatenate([positions, turned], axis=2)[:, None].repeat(2, axis=1))
    forces = palpate.Simulation(scene).run(positions, turned)
    assert np.array_equal(wrenches[:, 0, :, :3], forces) and np.array_equal(wrenches[:, 1, :, :3], forces)
    assert np.abs(forces).max(axis=(0, 2)).min() > 0.01


def test_without_limits_of_the_device_wrenches_are_those_of_the_contacts(block, block_green):
    scene = scene_of(block, block_green, device={"ramp": 0.5, "max_force": 0.02})
    sensor = palpate.Sensor(scene, 3, device_limits=False)
    positions = paths(120, 3)
    wrenches = stepped(sensor, with_orientation(positions)[:61])[-1]
    contacts = sensor.contacts
    assert np.array_equal(contacts.copy, [0, 1, 2]) and not contacts.tool.any() and not contacts.limited.any()
    assert np.allclose(wrenches[:, 0, :3], -contacts.force, rtol=1e-14) and wrenches[:, 0, 2].min() > 0.05
    assert np.array_equal(sensor.net_forces_w[:, 0], -contacts.force)
    assert np.allclose(sensor.contact_pos_w[:, 0], contacts.point)
    assert np.allclose(np.linalg.norm(contacts.normal, axis=1), 1) and (contacts.radius > 1e-3).all()
    # Free, each tool has the force of a device without limits.
    free = scene_of(block, block_green, device={"ramp": 0, "max_slew": 1e9})
    assert np.allclose(palpate.Simulation(free).run(positions[:61, 1])[-1], wrenches[1, 0, :3], rtol=1e-12)


def test_a_tool_that_is_out_of_the_scene_and_a_copy_begun_anew(block, block_green):
    sensor = palpate.Sensor(scene_of(block, block_green), 2, device_limits=False)
    down = with_orientation(np.array([[0.04, 0.025, 0.054]] * 2))
    high = with_orientation(np.array([[0.04, 0.025, 0.07]] * 2))
    for part in np.linspace(0, 1, 40):
        wrenches = sensor.step(high + part * (down - high))
    assert wrenches[:, 0, 2].min() > 0.01
    down[0, :3] = np.nan
    wrenches = sensor.step(down)
    assert not wrenches[0].any() and wrenches[1, 0, 2] > 0.01
    assert np.isnan(sensor.contact_pos_w[0]).all() and len(sensor.contacts) == 1
    sensor.reset([False, True])
    assert not sensor.step(down)[1].any()
    sensor.reset()
    sensor.reset(np.array([1]))


def test_dt_drives_moving_bodies(block, block_green):
    moving = palpate.Scene(body={"model": "beam"}, dynamics={"modes": 8}, view={"strain_limit": 0}, device={"ramp": 0})
    motion = moving.dynamics.build(block, moving.device.max_stiffness, False)
    sensors = [palpate.Sensor(BuiltScene.of(moving, block, block_green, motion)) for _ in range(2)]
    positions = paths(100, 1)
    forces = [[s.step(with_orientation(p), dt) for p in positions] for s, dt in zip(sensors, (1e-3, 2e-3), strict=True)]
    assert np.abs(np.array(forces[0]) - forces[1]).max() > 1e-4


@pytest.mark.parametrize(
    ("tool", "peak"),
    [
        ({"radius": 0.006}, None),
        ({"shape": "ellipsoid", "semi_axes": [0.006, 0.006, 0.006]}, None),
        ({"shape": "punch", "radius": 0.004}, None),
    ],
)
def test_taxels_carry_the_normal_force(block, block_green, tool, peak):
    sensor = palpate.Sensor(scene_of(block, block_green, tool), taxels=(16, 12), device_limits=False)
    front = tool.get("radius", 0.006) if tool.get("shape") != "punch" else 0.0
    for depth in np.linspace(0, 0.002, 40):
        sensor.step([0.04, 0.025, 0.05 + front - depth, *IDENTITY])
    contacts, pressures = sensor.contacts, sensor.pressures[0, 0]
    assert pressures.shape == (16, 12)
    side = 2 * tool.get("radius", 0.006)
    force = -(contacts.force * contacts.normal).sum()
    assert force > 0.05 and pressures.sum() * side**2 / 192 == pytest.approx(force, rel=1e-6)
    assert pressures.min() == 0 or tool.get("shape") == "punch"


def test_taxels_of_a_ball_read_hertz_and_turn_with_the_tool(block, block_green):
    """Hertz 1881: `p0 sqrt(1 - r^2/a^2)`; Sneddon 1965: `int_r^a g'(s) ds / sqrt(s^2 - r^2)`, `g = s artanh(s/R)`."""
    sensor = palpate.Sensor(scene_of(block, block_green), 2, taxels=(32, 32), device_limits=False)
    angle = 0.3
    tilted = (np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0)
    for depth in np.linspace(0, 0.001, 40):
        pose = [0.04, 0.025, 0.056 - depth]
        sensor.step(np.array([[*pose, *IDENTITY], [*pose, *tilted]]))
    contact, (level, inclined) = sensor.contacts, sensor.pressures[:, 0]
    middle = (np.arange(32) - 15.5) / 32 * 0.012
    x, y = np.meshgrid(middle, middle)
    radius, force = contact.radius[0], np.linalg.norm(contact.force[0])
    squared = (x**2 + y**2) / radius**2
    hertz = 1.5 * force / (np.pi * radius**2) * np.sqrt(np.clip(1 - squared, 0, None))
    inside = squared < 0.6
    assert inside.sum() > 50 and np.abs(level - hertz)[inside].max() < 0.04 * hertz.max()
    # With s^2 = r^2 + v^2 the root goes out of the integral.
    v = (np.arange(2000) + 0.5) / 2000 * np.sqrt(np.clip(1 - squared, 0, None))[..., None]
    s = np.sqrt(np.minimum(squared, 1)[..., None] + v**2) * radius / 0.006
    slope = (np.arctanh(s) + s / (1 - s**2)) / s
    sneddon = slope.mean(axis=2) * np.sqrt(np.clip(1 - squared, 0, None))
    sneddon *= force / (sneddon.sum() * (0.012 / 32) ** 2)
    assert np.abs(level - sneddon)[inside].max() < 0.015 * sneddon.max()
    # Inclined about y, the contact is seen towards -x of the tool (its x points down by as much).
    seen = (inclined * x).sum() / inclined.sum()
    # Its plane lies between the pressed depth of a millimetre and the ball's surface.
    assert 0.005 * np.sin(angle) < seen < 0.006 * np.sin(angle)
    assert inclined.sum() == pytest.approx(level.sum(), rel=1e-3)


def test_copies_share_the_store(block, block_green):
    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096

    scene = scene_of(block, block_green)
    before = resident()
    sensor = palpate.Sensor(scene, 64)
    sensor.step(with_orientation(paths(1, 64)[0]))
    assert (resident() - before) / 64 < 3e6, "a copy takes more than 3 MB"


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("count must be", lambda scene: palpate.Sensor(scene, 0)),
        ("count must be", lambda scene: palpate.Sensor(scene, 1.5)),
        ("taxels must be", lambda scene: palpate.Sensor(scene, taxels=16)),
        ("number of taxels", lambda scene: palpate.Sensor(scene, taxels=(16, 0))),
        ("taxel_size", lambda scene: palpate.Sensor(scene, taxels=(4, 4), taxel_size=-1.0)),
        ("shape", lambda scene: palpate.Sensor(scene, 2).step(np.zeros((3, 1, 7)))),
        ("unit quaternion", lambda scene: palpate.Sensor(scene).step(np.zeros(7))),
        ("dt must", lambda scene: palpate.Sensor(scene).step([0, 0, 1, *IDENTITY], dt=0.0)),
        ("copies must be", lambda scene: palpate.Sensor(scene).reset([1])),
        ("mask", lambda scene: palpate.Sensor(scene).reset([True, False])),
        ("no taxels", lambda scene: palpate.Sensor(scene).pressures),
    ],
)
def test_what_cannot_be_is_refused(block, block_green, words, make):
    with pytest.raises(palpate.SceneError, match=words):
        make(scene_of(block, block_green))


def test_taxels_need_pressures(block, block_green):
    patch = {"radius": 0.006, "contact": "patch", "contact_radius": 0.008}
    with pytest.raises(palpate.SceneError, match="'patch'"):
        palpate.Sensor(scene_of(block, block_green, patch), taxels=(4, 4))
