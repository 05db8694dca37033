"""The viewer's server with a body in motion: strikes, slow motion, mode shapes."""

from __future__ import annotations

import asyncio
import re

import numpy as np
import pytest
from viewer_client import page, serving

import palpate
from palpate.cli.impulse import impulse_history, impulse_scene
from palpate.scene import BuiltScene
from palpate.viewer.session import Session

TOP = [0.04, 0.025, 0.05]


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    return BuiltScene.of(palpate.Scene.of_store("block.palpate"), block, block_green)


@pytest.fixture(scope="module")
def moving(block, block_green) -> BuiltScene:
    """The block in motion, with a strike of its own."""
    strike = {"point": TOP, "impulse": [0, 0, -1e-3]}
    scene = palpate.Scene(
        body={"store": "block.palpate"},
        tool={"contact": "patch"},
        view={"strain_limit": 0.1},
        dynamics={"strike": strike},
    )
    motion = scene.dynamics.build(block, scene.device.max_stiffness, progress=False)
    return BuiltScene.of(scene, block, block_green, motion)


def test_a_body_in_motion_is_struck_slowed_and_shown_by_modes(moving):
    async def session():
        async with serving(moving) as server, page(server) as client, page(server) as watcher:
            scene, arrays = await client.receive("scene")
            result = scene["motion"]
            assert result["frequencies"] == pytest.approx(moving.bodies[0].motion.basis.frequencies[:20].tolist())
            assert scene["bodies"][0]["youngs_modulus"] is None and result["youngs_modulus"] == pytest.approx(10e3)
            assert 0 < result["impulse"] < result["max_impulse"]
            assert not arrays["0/free"].any()
            await client.say(type="set", time_scale=0.25)
            settings, _ = await watcher.receive("settings")
            assert settings["time_scale"] == 0.25
            await client.say(type="strike", point=TOP, impulse=[0, 0, -result["impulse"]])
            _, arrays = await watcher.frame_where(lambda h: h["motion"]["struck_at"] is not None and h["strain"] > 1e-3)
            header, arrays = await client.frame_where(lambda h: h["motion"]["struck_at"] is not None)
            top = np.argmin(np.linalg.norm(moving.bodies[0].green.surface_positions - TOP, axis=1))
            assert header["motion"]["watched"] == top
            while not len(arrays["history"]):
                _, arrays = await client.receive("frame")
            time, energy = arrays["history"][-1, 0], arrays["history"][-1, 4:]
            assert time > 0 and 0 < energy[2] <= energy[3] * (1 + 1e-4)
            # A mode is drawn in place of the motion, at a pace of its own; the body is at rest under it.
            await client.say(type="mode", number=3)
            swung = lambda h: h["motion"]["mode"] and h["strain"] > 0.05  # noqa: E731
            header, arrays = await watcher.frame_where(swung)
            assert header["motion"]["mode"]["frequency"] == pytest.approx(moving.bodies[0].motion.basis.frequencies[2])
            assert header["strain"] <= 0.1 + 1e-6
            shape = moving.bodies[0].motion.basis.shapes[moving.bodies[0].green.surface_nodes, :, 2]
            alike = abs((shape * arrays["0/displacements"]).sum()) / np.linalg.norm(shape)
            assert alike == pytest.approx(np.linalg.norm(arrays["0/displacements"]), rel=1e-5)
            assert np.abs(server._session.simulation.frame().displacements).max() == 0
            # Its own strike ends that.
            await client.say(type="repeat")
            await watcher.frame_where(lambda h: h["motion"]["mode"] is None and h["motion"]["struck_at"] is not None)
            await client.say(type="mode", number=1)
            await watcher.frame_where(lambda h: h["motion"]["mode"] is not None)
            await client.say(type="press", tool=0, position=[*TOP[:2], 0.054], grab=False)
            await watcher.frame_where(lambda h: h["motion"]["mode"] is None and len(h["contacts"]) == 1)
            await client.say(type="reset")
            await watcher.frame_where(lambda h: h["contacts"] == [] and h["strain"] < 1e-6)

    asyncio.run(session())


OUT_OF_BOUNDS = [
    ('{"type": "strike", "point": [0, 0, 0], "impulse": [0, 0, 1e9]}', "the impulse must lie between"),
    ('{"type": "strike", "point": [0, 0, 0], "impulse": [0, 0, 0]}', "the impulse must lie between"),
    ('{"type": "strike", "point": [9, 0, 0], "impulse": [0, 0, 1e-6]}', "far away"),
    ('{"type": "strike", "point": [0, 0, NaN], "impulse": [0, 0, 1e-6]}', "not JSON"),
    ('{"type": "strike", "point": [0, 0, 0], "impulse": 1e-6}', "three numbers"),
    ('{"type": "strike", "body": 1, "point": [0, 0, 0], "impulse": [0, 0, 1e-6]}', "body must be"),
    ('{"type": "mode"}', "whole number from 0 to 20"),
    ('{"type": "mode", "number": 21}', "whole number from 0 to 20"),
    ('{"type": "mode", "number": 1.5}', "whole number"),
    ('{"type": "mode", "number": true}', "whole number"),
    ('{"type": "set", "time_scale": 0}', r"\(0, 1\]"),
    ('{"type": "set", "time_scale": 2}', r"\(0, 1\]"),
    ('{"type": "set", "body": 0, "youngs_modulus": 1e4}', "moves"),
]


def test_motion_messages_are_bounded(moving):
    async def session():
        async with serving(moving) as server, page(server) as client, page(server) as watcher:
            await client.receive("scene")
            await watcher.receive("scene")
            for text, reason in OUT_OF_BOUNDS:
                await client.socket.send(text)
                error, _ = await client.receive("error")
                assert re.search(reason, error["text"]), text
                await watcher.socket.send(text.replace("NaN", "0"))
                error, _ = await watcher.receive("error")
                assert "another viewer has control" in error["text"], text
                assert server._session.simulation.frame().energy.work == 0, text

    asyncio.run(session())


MESSAGES_OF_MOTION = [
    {"type": "strike", "point": TOP, "impulse": [0, 0, -1e-6]},
    {"type": "repeat"},
    {"type": "mode", "number": 1},
    {"type": "set", "time_scale": 0.5},
]


def test_a_body_at_rest_takes_no_motion_messages(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert scene["motion"] is None
            for message in MESSAGES_OF_MOTION:
                await client.say(**message)
                error, _ = await client.receive("error")
                assert "does not move" in error["text"], message
                header, arrays = await client.receive("frame")
                assert header["motion"] is None and len(arrays["history"]) == 0, message

    asyncio.run(session())


def test_the_impulse_in_the_viewer_is_that_of_the_offline_history(tmp_path):
    """The same node, strike and scheme by two ways: modes through the loop's ticks, and a sparse factor."""
    impulse_history("beam", True, 0.1, tmp_path)
    table = np.genfromtxt(tmp_path / "beam-paper-impulse.csv", delimiter=",", names=True)
    built = impulse_scene("beam", True).build(False)
    strike = built.scene.dynamics.strike
    simulation = palpate.Simulation(built)
    node = int(np.argmin(np.linalg.norm(built.bodies[0].body.mesh.nodes - strike.point, axis=1)))
    played = simulation.play(np.full((100, 3), np.nan), strikes=[(0, strike.point, strike.impulse)], watch=[node])
    there = np.column_stack([table[name] for name in ("ux_m", "uy_m", "uz_m")])[1:]
    assert played.displacements[:, 0] == pytest.approx(there, abs=1e-6 * np.abs(there).max())


def test_the_default_strike_swings_a_body_visibly_and_honestly(moving):
    """Struck along the inward normal at places all over: some swing visibly, and few strain it beyond 10 %."""
    session = Session(moving)
    session.close()
    body, surface, mover = moving.bodies[0].body, moving.bodies[0].green.surface_nodes, session._moving
    outward = body.mesh.nodes - body.mesh.nodes.mean(axis=0)
    strains, swings = [], []
    for node in np.setdiff1d(surface, body.fixed_nodes)[::9]:
        impulse = -mover.impulse * outward[node] / np.linalg.norm(outward[node])
        strikes = [(0, body.mesh.nodes[node], impulse, mover._duration)]
        played = session.simulation.play(np.full((300, 3), np.nan), strikes=strikes, watch=surface)
        strains.append(max(moving.bodies[0].green.strain_measure.largest(pose) for pose in played.displacements[::4]))
        swings.append(np.linalg.norm(played.displacements, axis=2).max() / session.size)
    assert np.median(strains) < 0.1 and max(strains) < 0.25
    assert max(swings) > 0.03


def test_a_large_body_swings_and_is_struck_like_a_small_one(moving, monkeypatch):
    """The strain of a body whose inside is not followed is that of its surface: about the same for a first mode."""
    whole = Session(moving)
    whole.close()
    monkeypatch.setattr("palpate.green.function.MOST_NODES_INSIDE", 0)
    monkeypatch.delitem(vars(moving.bodies[0].green), "strain_measure")
    large = Session(moving)
    large.close()
    assert large._moving.impulse == pytest.approx(whole._moving.impulse, rel=0.5)
    swings = [session._moving._prepare_mode(3).header["amplitude"] for session in (whole, large)]
    assert swings[1] == pytest.approx(swings[0], rel=0.5)


@pytest.mark.slow
def test_the_tool_is_limited_in_motion(moving):
    """By the static response: the body comes to rest within the limit, though the tool is 20 mm deep."""

    async def session():
        async with serving(moving) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            radius = scene["tools"][0]["radius"]
            # Slow motion would only take longer.
            await client.say(type="set", time_scale=1)
            await client.say(type="press", tool=0, position=[*TOP[:2], TOP[2] + radius + 1e-3], grab=False)
            await client.receive("frame")
            # A tool that falls 20 mm at once bounces, and is met anew from where it then is.
            for depth in np.linspace(0.0, 0.02, 41):
                await client.say(type="press", tool=0, position=[*TOP[:2], TOP[2] + radius - depth], grab=False)
                await asyncio.sleep(0.02)
            landed, _ = await client.frame_where(lambda h: h["contacts"] != [])
            header, _ = await client.frame_where(lambda h: h["contacts"] != [] and h["time"] > landed["time"] + 2.5)
            assert 0.05 < header["strain"] < 0.105
            assert header["tools"][0]["force"][2] > 0.05
            await client.say(type="release")
            await client.frame_where(lambda h: h["contacts"] == [] and h["strain"] < 0.01)

    asyncio.run(session())
