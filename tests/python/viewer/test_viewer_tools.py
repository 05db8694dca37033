"""Shapes of tools in the page's server: which are offered, how large they are, how they are turned."""

from __future__ import annotations

import asyncio
import time

import numpy as np
import pytest
import trimesh
from viewer_client import page, serving, settled

import palpate
from palpate.scene import BuiltScene
from palpate.viewer.session import Session

TOP = np.array([0.04, 0.025, 0.05])
RADIUS = 5e-3
# Turned so that the tool's own axis, its z, lies along x.
LYING = [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]


def scene_with(block, block_green, **tool) -> BuiltScene:
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=tool, view={"strain_limit": 0})
    return BuiltScene.of(scene, block, block_green)


def names_of(scene: dict) -> list[str]:
    return [choice["name"] for choice in scene["tools"][0]["shapes"]]


def test_every_closed_shape_is_offered_in_the_size_of_the_tools_radius(block, block_green):
    built = scene_with(block, block_green, radius=RADIUS, friction=0.2)

    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert names_of(scene) == ["sphere", "ellipsoid", "capsule", "punch"]
            await client.say(type="set", friction=0.7, tool=0)
            sizes = {}
            for name in ("ellipsoid", "capsule", "punch", "sphere"):
                await client.say(type="shape", tool=0, name=name)
                scene, _ = await client.receive("scene")
                (tool,) = scene["tools"]
                assert tool["shape"] == name and tool["friction"] == 0.7
                sizes[name] = np.array(tool["lengths"]) / RADIUS
            assert sizes["sphere"][0] == 1
            assert (sizes["ellipsoid"] >= 1).all() and sizes["ellipsoid"][2] == 1
            assert sizes["capsule"][1] > 2 * sizes["capsule"][0] > 0
            assert sizes["punch"][0] == 1 > sizes["punch"][1] > 0

    asyncio.run(session())


def test_a_tool_that_is_turned_presses_with_its_side(block, block_green):
    """A stylus on its side touches sooner than one that stands on its front, and its torque is force times lever."""
    radius, length = 3e-3, 20e-3
    built = scene_with(block, block_green, shape="capsule", radius=radius, length=length, friction=0.0)

    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert scene["tools"][0]["lengths"][:2] == [radius, length]
            place = (TOP + [-0.5 * length, 0, radius - 1e-3]).tolist()
            await client.say(type="press", tool=0, position=place, grab=False, orientation=LYING)
            side, _ = await settled(client, lambda h: h["time"] > 0.5)
            assert side["tools"][0]["orientation"] == pytest.approx(LYING, abs=1e-9)
            # Without an orientation it keeps the one that it has.
            await client.say(type="press", tool=0, position=place, grab=False)
            assert (await client.receive("frame"))[0]["tools"][0]["orientation"] == pytest.approx(LYING, abs=1e-9)
            await client.say(type="press", tool=0, position=place, grab=False, orientation=[1, 0, 0, 0])
            upright = lambda h: h["tools"][0]["orientation"] == pytest.approx([1, 0, 0, 0], abs=1e-9)  # noqa: E731
            front, _ = await settled(client, upright)
            # On its side it is a cylinder of 20 mm, on its front a ball whose contact is 4 mm across at this depth.
            assert side["tools"][0]["force"][2] > 2 * front["tools"][0]["force"][2] > 0

    asyncio.run(session())


@pytest.mark.parametrize(
    "orientation", [[1, 0, 0], [2, 0, 0, 0], "upright", [1, 0, 0, None], [1, 0, 0, 0, 0], [True, 0, 0, 0]]
)
def test_what_is_no_orientation_is_refused(block, block_green, orientation):
    built = scene_with(block, block_green, radius=RADIUS)

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.say(type="press", tool=0, position=TOP.tolist(), grab=False, orientation=orientation)
            error, _ = await client.receive("error")
            assert "orientation" in error["text"]
            header, _ = await client.receive("frame")
            assert not header["tools"][0]["active"] and header["fault"] is None

    asyncio.run(session())


def test_a_scenes_own_surface_is_offered_and_sent_whole(block, block_green, tmp_path):
    probe = trimesh.creation.icosphere(subdivisions=2, radius=6.0)
    probe.apply_scale([1.0, 1.5, 1.0])
    probe.export(tmp_path / "probe_tip.stl")
    built = scene_with(block, block_green, shape=str(tmp_path / "probe_tip.stl"), unit="mm")

    async def session():
        async with serving(built) as server, page(server) as client:
            scene, arrays = await client.receive("scene")
            (tool,) = scene["tools"]
            assert tool["shape"] == "surface" and {"name": "surface", "title": "Probe tip"} in tool["shapes"]
            assert tool["radius"] == pytest.approx(6e-3, rel=0.01)
            corners = arrays["tools/0/vertices"][arrays["tools/0/triangles"]].astype(float)
            volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
            assert volume == pytest.approx(1e-9 * probe.volume, rel=1e-5)
            await client.say(type="shape", tool=0, name="sphere")
            scene, arrays = await client.receive("scene")
            assert scene["tools"][0]["lengths"][0] == tool["radius"] and len(arrays["tools/0/vertices"]) == 0
            await client.say(type="shape", tool=0, name="surface")
            scene, arrays = await client.receive("scene")
            assert scene["tools"][0]["shape"] == "surface" and len(arrays["tools/0/triangles"]) == len(probe.faces)

    asyncio.run(session())


def test_a_tool_that_sticks_stays_a_sphere(block, block_green):
    built = scene_with(block, block_green, contact="patch")

    async def session():
        async with serving(built) as server, page(server) as client:
            assert names_of((await client.receive("scene"))[0]) == ["sphere"]
            await client.say(type="shape", tool=0, name="punch")
            assert "may be sphere" in (await client.receive("error"))[0]["text"]

    asyncio.run(session())


def test_a_press_during_a_change_of_tool_goes_on_with_the_new_one(block, block_green, monkeypatch):
    """Changing takes seconds on large bodies: the last press is kept, one that was let go of is not."""
    built = scene_with(block, block_green, radius=RADIUS, friction=0.2)
    deep = (TOP - [0.0, 0.0, 5e-4]).tolist()
    make = Session.__init__

    def take_long(session, *arguments):
        time.sleep(0.5)
        make(session, *arguments)

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            monkeypatch.setattr(Session, "__init__", take_long)
            for held in (True, False):
                await client.say(type="shape", tool=0, name="punch" if held else "sphere")
                text = ""
                while not text.startswith("Preparing the tool"):
                    text = (await client.receive("status"))[0]["text"]
                await client.say(type="press", tool=0, position=TOP.tolist(), grab=False)
                await client.say(type="press", tool=0, position=deep, grab=False)
                if not held:
                    await client.say(type="release", tool=0)
                scene, _ = await client.receive("scene")
                assert scene["tools"][0]["shape"] == ("punch" if held else "sphere")
                if held:
                    await client.frame_where(lambda header: header["tools"][0]["force"][2] > 0.02)
                else:
                    header, _ = await client.receive("frame")
                    assert not header["tools"][0]["active"]

    asyncio.run(session())


def test_a_tool_that_cannot_be_taken_leaves_the_one_before(block, block_green, monkeypatch):
    """Whatever a new loop fails of, the page is told, and the frames of the one before go on."""
    built = scene_with(block, block_green, radius=RADIUS, friction=0.2)
    start = Session.start

    def refuse(session):
        if session.built.scene.tools[0].shape == "punch":
            raise palpate.DeviceError("the device is disconnected: connect it again")
        if session.built.scene.tools[0].shape == "capsule":
            raise ZeroDivisionError("of no kind that is expected")
        start(session)

    monkeypatch.setattr(Session, "start", refuse)

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            for name, words in (
                ("punch", "connect it again; the scene shown before stays"),
                ("capsule", "report it"),
            ):
                await client.say(type="shape", tool=0, name=name)
                notice, _ = await client.receive("error")
                assert words in notice["text"] and "\n" not in notice["text"]
                scene, _ = await client.receive("scene")
                assert scene["tools"][0]["shape"] == "sphere"
                before, _ = await client.receive("frame")
                await client.frame_where(lambda header, before=before: header["ticks"] > before["ticks"])
            await client.say(type="press", tool=0, position=TOP.tolist(), grab=False)
            await client.frame_where(lambda header: header["tools"][0]["force"][2] > 0.02)

    asyncio.run(session())
