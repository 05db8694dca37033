"""Another model in the viewer: the one shown goes on until it is ready, and the work can be cancelled."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from viewer_client import page, serving

import palpate
from benches.viewer import servo_threads
from palpate.scene import BuiltScene


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    return BuiltScene.of(palpate.Scene.of_store("block.palpate"), block, block_green)


def test_another_model_is_shown_when_it_is_ready(built):
    def scene_of(name):
        return palpate.Scene(body={"model": name, "paper": True})

    async def session():
        async with serving(built, models=["beam"], scene_of=scene_of) as server, page(server) as client:
            welcome, _ = await client.receive("welcome")
            assert welcome["models"] == [{"name": "beam", "title": "Beam"}]
            await client.receive("scene")
            await client.say(type="model", name="beam")
            scene, arrays = await client.receive("scene")
            assert scene["name"] == "beam"
            _, arrays = await client.receive("frame")
            assert len(arrays["0/displacements"]) == scene["bodies"][0]["surface_nodes"]

    asyncio.run(session())


BLOCK = Path(__file__).parents[3] / "examples" / "block.obj"
LONG = {
    # A mesher reports no progress: it is left to itself.
    "Loading": {
        "body": {"mesh": str(BLOCK), "unit": "mm", "max_element_size": "3mm"},
        "supports": {"fixed": "z < 1mm"},
    },
    "Solving": {"body": {"model": "doll"}},
    "Computing": {"body": {"model": "beam", "paper": True}, "dynamics": {"modes": "all"}},
}


@pytest.mark.quick(2)
@pytest.mark.parametrize("phase", LONG)
def test_long_work_is_cancelled(built, monkeypatch, tmp_path, phase):
    """The page is free at once; the body shown goes on, and another model may be chosen."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scenes = {"long": LONG[phase], "beam": {"body": {"model": "beam", "paper": True}}}

    def scene_of(name):
        return palpate.Scene(**scenes[name])

    async def session():
        async with serving(built, models=list(scenes), scene_of=scene_of) as server, page(server) as client:
            await client.receive("scene")
            _, before = await client.receive("frame")
            ticks = (await client.receive("frame"))[0]["ticks"]
            await client.say(type="model", name="long")
            status, _ = await client.receive("status")
            while not status["text"].startswith(phase):
                status, _ = await client.receive("status")
                assert status["text"], "the work was over too soon"
            await client.say(type="cancel")
            error, _ = await client.receive("error")
            assert error["text"] == "cancelled: the body shown before stays"
            while status["text"]:
                status, _ = await client.receive("status")
            header, after = await client.receive("frame")
            assert header["ticks"] > ticks and header["fault"] is None
            assert after["0/displacements"].shape == before["0/displacements"].shape
            assert servo_threads() in {None, 1}
            # A cancel with nothing under way is not kept for the next one.
            await client.say(type="cancel")
            await client.say(type="model", name="beam")
            scene, _ = await client.receive("scene")
            assert scene["name"] == "beam"
            assert servo_threads() in {None, 1}

    asyncio.run(session())
