"""Recordings that the server makes for its pages."""

from __future__ import annotations

import asyncio
import resource

import pytest
from viewer_client import page, serving

import palpate
from palpate.scene import BuiltScene
from palpate.viewer.recorder import SessionRecorder

TOP = [0.04, 0.025, 0.05]


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"radius": "6mm"})
    return BuiltScene.of(scene, block, block_green)


def replayed(path, built):
    return palpate.replay(palpate.Recording.load(path), built)


def test_another_tool_ends_the_recording_and_says_so(built, tmp_path):
    async def session():
        async with serving(built, recordings=tmp_path) as server, page(server) as client, page(server) as watcher:
            await watcher.receive("scene")
            await watcher.say(type="record", on=True)
            error, _ = await watcher.receive("error")
            assert "another viewer has control" in error["text"]
            await client.say(type="press", tool=0, position=TOP, grab=False)
            await client.frame_where(lambda h: h["contacts"])
            await client.say(type="record", on=True)
            # The loop begins anew with nothing touched.
            header, _ = await client.frame_where(lambda h: h["recording"])
            assert not header["tools"][0]["active"]
            await client.say(type="press", tool=0, position=TOP, grab=False)
            await client.frame_where(lambda h: h["contacts"] and h["recording"]["ticks"] > 50)
            await client.say(type="record", on=True)
            error, _ = await client.receive("error")
            assert "already" in error["text"]
            await client.say(type="shape", tool=0, name="punch")
            message, _ = await watcher.receive("recorded")
            assert message["error"] is None and "another now" in message["reason"]
            assert message["dropped"] == 0 and message["ticks"] > 50
            await client.frame_where(lambda h: h["recording"] is None)
            return message

    message = asyncio.run(session())
    result = replayed(message["path"], built)
    assert result.same and result.whole and result.ticks == message["ticks"]


def test_a_recording_that_fails_is_told_and_the_loop_goes_on(built, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    async def session():
        async with serving(built, recordings=tmp_path) as server, page(server) as client:
            await client.receive("scene")
            await client.say(type="record", on=True)
            message, _ = await client.receive("recorded")
            assert message["error"] is not None and message["reason"] is None
            header, _ = await client.frame_where(lambda h: h["recording"] is None)
            await client.frame_where(lambda h: h["ticks"] > header["ticks"] + 10)
            return message

    # No file may grow beyond this, as on a disk that is full.
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, before[1]))
    try:
        message = asyncio.run(session())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    result = replayed(message["path"], built)
    assert result.same and not result.whole and result.ticks > 10


def test_what_the_command_line_records_is_told_and_ends_with_the_server(built, tmp_path):
    async def session():
        async with serving(built, record=tmp_path / "given.mcap") as server, page(server) as client:
            header, _ = await client.frame_where(lambda h: h["recording"] and h["recording"]["ticks"] > 20)
            assert header["recording"]["path"] == str(tmp_path / "given.mcap")

    asyncio.run(session())
    assert replayed(tmp_path / "given.mcap", built).whole


def test_no_name_is_given_twice(built, tmp_path, monkeypatch):
    monkeypatch.setattr("time.strftime", lambda *_: "20260102-030405")
    with palpate.Simulation(built) as simulation:
        recorder = SessionRecorder(simulation, tmp_path)
        paths = []
        for _ in range(2):
            recorder.start()
            paths.append(recorder.stop()["path"])
        (tmp_path / f"{built.scene.name}-20260102-030405-3.mcap").write_text("of somebody else")
        recorder.start()
        paths.append(recorder.stop()["path"])
    stem = str(tmp_path / f"{built.scene.name}-20260102-030405")
    assert paths == [f"{stem}.mcap", f"{stem}-2.mcap", f"{stem}-4.mcap"]
