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
            told, _ = await watcher.receive("recorded")
            assert told["error"] is None and "another now" in told["reason"]
            assert told["dropped"] == 0 and told["ticks"] > 50
            await client.frame_where(lambda h: h["recording"] is None)
            return told

    told = asyncio.run(session())
    made = replayed(told["path"], built)
    assert made.same and made.whole and made.ticks == told["ticks"]


def test_a_recording_that_fails_is_told_and_the_loop_goes_on(built, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    async def session():
        async with serving(built, recordings=tmp_path) as server, page(server) as client:
            await client.receive("scene")
            await client.say(type="record", on=True)
            told, _ = await client.receive("recorded")
            assert told["error"] is not None and told["reason"] is None
            header, _ = await client.frame_where(lambda h: h["recording"] is None)
            await client.frame_where(lambda h: h["ticks"] > header["ticks"] + 10)
            return told

    # No file may grow beyond this, as on a disk that is full.
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, before[1]))
    try:
        told = asyncio.run(session())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    made = replayed(told["path"], built)
    assert made.same and not made.whole and made.ticks > 10


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
