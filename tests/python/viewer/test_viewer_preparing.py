"""A page that opens before its scene is ready."""

from __future__ import annotations

import asyncio
import threading

import numpy as np
import pytest
import trimesh
from viewer_client import page, serving

import palpate
from palpate.scene import BuiltScene
from palpate.viewer.live import Preparation, Prepared, PreparingSession, prepare


def test_the_surface_is_drawn_and_stages_are_shown_before_the_body_can_be_touched(block, block_green):
    built = BuiltScene.of(palpate.Scene.of_store("block.palpate"), block, block_green)
    ball, go_on = trimesh.creation.icosphere(2, 0.03), threading.Event()

    def build(reporter, draw):
        draw(np.asarray(ball.vertices), np.asarray(ball.faces))
        reporter.phase("wrapping")
        reporter(3, 6)
        assert go_on.wait(30)
        reporter.phase("columns")
        reporter(50, 100)
        return Prepared(built, {})

    async def session():
        async with serving(PreparingSession()) as server, page(server) as client:
            preparing = asyncio.create_task(prepare(server, Preparation("block", build)))
            setup, _ = await client.receive("setup")
            assert setup["preparing"] and not setup["editing"] and setup["limit"] == 0
            scene = {"bodies": []}
            while not scene["bodies"]:
                scene, arrays = await client.receive("scene")
            assert len(arrays["0/nodes"]) == len(ball.vertices) and scene["tools"] == []
            await client.say(type="upload", name="a.stl", size=10)
            assert "no body can be set up here" in (await client.receive("error"))[0]["text"]
            go_on.set()
            status = {"text": "", "progress": None}
            while status["text"] != "block: columns" or status["progress"] is None:
                status, _ = await client.receive("status")
            # Half of the columns took some milliseconds: what is left is known.
            assert status["progress"] == 0.5 and 0 <= status["left_s"] < 30
            await client.frame_where(lambda header: len(header["tools"]) == 1)
            await preparing

    asyncio.run(session())


def test_what_cannot_be_prepared_is_told_to_the_page_and_to_the_caller():
    def build(reporter, draw):
        raise palpate.MeshError("broken")

    async def session():
        async with serving(PreparingSession()) as server, page(server) as client:
            await client.receive("scene")
            with pytest.raises(palpate.MeshError, match="broken"):
                await prepare(server, Preparation("block", build))
            assert (await client.receive("error"))[0]["text"] == "broken"

    asyncio.run(session())
