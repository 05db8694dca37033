"""What comes at the wrong moment: pages that do not read, sessions that change while something waits, and failures."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from setup_client import empty_page, filled, send, setup_where
from viewer_client import page, serving
from websockets.asyncio.client import connect

import palpate
from palpate.errors import DeviceError, MeshError, ViewerError
from palpate.scene import BuiltScene, Scene
from palpate.simulation import Recording, ReplayedSimulation, Simulation
from palpate.viewer import messages, setting_up
from palpate.viewer import session_host as clients
from palpate.viewer.replay_session import ReplaySession
from palpate.viewer.session import Session
from palpate.viewer.session_host import ONE_SCENE

BALL = trimesh.creation.icosphere(3, 40.0)
PRESS = {"type": "press", "tool": 0, "position": [0.083, 0.025, 0.025], "grab": False}


@pytest.fixture
def ball(tmp_path):
    BALL.export(tmp_path / "ball.stl")
    return tmp_path / "ball.stl"


@pytest.fixture
def saves(tmp_path):
    (tmp_path / "saves").mkdir()
    return tmp_path / "saves"


@pytest.fixture
def built(block, block_green) -> BuiltScene:
    return BuiltScene.of(Scene(body={"model": "beam"}, tool={"radius": "5mm"}), block, block_green)


@pytest.fixture
def part_green(block, tmp_path) -> palpate.GreensFunction:
    nodes = block.mesh.surface_nodes
    near = nodes[block.mesh.nodes[nodes, 0] > 0.05]
    return palpate.precompute(block, precision="f64", touch=near, path=tmp_path / "part.palpate", progress=False)


class StubGrowing:
    """What computes columns of a body, for a test that decides when they are ready."""

    def __init__(self, green, is_complete=False):
        self.region = np.sort(np.array(green.surface_nodes))
        self.waiting, self.done, self.columns = np.empty(0, int), 3, 3 * len(self.region)
        self.seconds_left, self.error, self.is_complete, self.is_closed = None, None, is_complete, False
        self.ready: list[palpate.GreensFunction] = []

    def take(self):
        return self.ready.pop() if self.ready else None

    def yield_processor(self):
        pass

    def close(self):
        self.is_closed = True


async def until(condition, limit: float = 20.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end
        await asyncio.sleep(0.02)


@pytest.fixture
def stalled_soon(monkeypatch):
    monkeypatch.setattr(clients, "STALLED_AFTER", 1.0)


def test_a_page_that_does_not_read_keeps_nobody_waiting(built, stalled_soon):
    async def session():
        async with serving(built) as server, page(server) as control:
            await control.receive("frame")
            server._server.sockets[0].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
            base = f"127.0.0.1:{server.port}"
            options = {"origin": f"http://{base}", "proxy": None, "max_queue": 1, "ping_interval": None}
            deaf = await connect(f"ws://{base}/socket", **options)
            await deaf.send(json.dumps({"type": "hello", "token": server.token, "version": messages.VERSION}))
            await until(lambda: len(server._clients) == 2)
            deaf.transport.pause_reading()
            for _ in range(200):
                server.send_all({"type": "status", "text": "x" * 100_000})
            await control.say(type="set", friction=0.3)
            settings, _ = await control.receive("settings", 10)
            assert settings["friction"] == [0.3] and len(server._clients) == 2
            await until(lambda: len(server._clients) == 1)
            deaf.transport.abort()

    asyncio.run(session())


def test_a_server_stops_though_a_page_does_not_read(built):
    async def session():
        async with serving(built) as server, page(server) as control:
            await control.receive("frame")

            async def never(_data):
                await asyncio.sleep(3600)

            server._clients[0].connection.send = never
            began = time.monotonic()
            await asyncio.wait_for(server.stop(), 60)
            assert time.monotonic() - began < 30 and not server.session.simulation._running

    asyncio.run(session())


def test_another_page_opens_though_the_file_of_the_tool_is_gone(block, block_green, tmp_path):
    file = tmp_path / "tip.stl"
    trimesh.creation.icosphere(2, 0.005).export(file)
    scene = Scene(body={"model": "beam"}, tool={"shape": str(file), "unit": "m"})

    async def session():
        async with serving(BuiltScene.of(scene, block, block_green)) as server, page(server) as first:
            await first.receive("frame")
            file.unlink()
            async with page(server) as second:
                header, arrays = await second.receive("scene")
                assert header["tools"][0]["shape"] == "surface" and len(arrays["tools/0/triangles"]) == 320

    asyncio.run(session())


def test_frames_that_fail_are_reported_once_and_tried_again(built, tmp_path):
    file = tmp_path / "press.mcap"
    with Simulation(built) as simulation:
        simulation.record(file)
        time.sleep(0.5)
    replay = ReplaySession(ReplayedSimulation(Recording.load(file), built))

    async def session():
        async with serving(replay) as server, page(server) as client:
            await client.frame_where(lambda header: header["replay"]["tick"] > 200)
            file.rename(tmp_path / "elsewhere.mcap")
            await client.say(type="replay", tick=1, play=True)
            error, _ = await client.receive("error")
            assert "press.mcap" in error["text"] and "\n" not in error["text"]
            (tmp_path / "elsewhere.mcap").rename(file)
            await client.frame_where(lambda header: header["replay"]["tick"] < 200)

    asyncio.run(session())


async def touched(server, client, ball) -> None:
    await filled(client, ball)
    await client.say(type="setup", unit="mm")
    await client.say(type="touch")
    await setup_where(client, lambda message: not message["editing"] and message["body"])
    assert isinstance(server.session, Session)


@pytest.mark.slow
def test_a_body_of_the_page_keeps_its_editor_and_reports_its_recording(ball, saves, shared_cache):
    async def session():
        async with empty_page(saves) as (server, client):
            await touched(server, client, ball)
            # While another tool is prepared the editor waits; after that it takes the body again.
            before = server.session
            await client.say(type="shape", tool=0, name="punch")
            await client.say(type="edit")
            error, _ = await client.receive("error")
            assert "wait until" in error["text"]
            await until(lambda: server.session is not before and not server.is_building)
            await client.say(type="save")
            await setup_where(client, lambda message: message["body"]["saved"])
            await client.say(type="record", on=True)
            await client.frame_where(lambda header: header["recording"])
            await client.say(type="edit")
            recorded, _ = await client.receive("recorded")
            assert recorded["reason"] == ONE_SCENE and recorded["path"].startswith(str(saves))
            await setup_where(client, lambda message: message["editing"])

    asyncio.run(session())


def test_a_file_ends_a_recording_with_a_message(built, ball, tmp_path):
    async def session():
        async with serving(built, recordings=tmp_path) as server, page(server) as client:
            await client.receive("frame")
            await client.say(type="record", on=True)
            await client.frame_where(lambda header: header["recording"])
            await send(client, "ball.stl", ball.read_bytes())
            recorded, _ = await client.receive("recorded")
            assert recorded["reason"] == ONE_SCENE

    asyncio.run(session())


def test_a_store_that_comes_while_a_tool_changes_is_kept(block, block_green, part_green):
    scene = Scene(body={"model": "beam"}, tool={"radius": "5mm"})
    built, growing = BuiltScene.of(scene, block, part_green), StubGrowing(block_green)

    async def session():
        async with serving(built, growing={0: growing}) as server, page(server) as client:
            await client.receive("frame")
            before = server.session
            other = Session(before.reshaped({"tool": 0, "name": "punch", "type": "shape"}), before.own_tools)
            growing.ready.append(block_green)
            await until(lambda: len(before.built.bodies[0].green.touchable_nodes) == len(block_green.touchable_nodes))
            await server.call(server._exchange_tool, other)
            assert server.session is other
            for bodies in (other.built.bodies, other.simulation.bodies):
                assert len(bodies[0].green.touchable_nodes) == len(block_green.touchable_nodes)
            assert not growing.is_closed

    asyncio.run(session())


def test_another_model_ends_what_is_computed_of_the_body_before(built, block, part_green):
    scene = Scene(body={"model": "beam"}, tool={"radius": "5mm"})
    growing = StubGrowing(part_green)
    model = SimpleNamespace(build=lambda *_: built)

    async def session():
        options = {"growing": {0: growing}, "models": ["beam"], "scene_of": lambda _: model}
        async with serving(BuiltScene.of(scene, block, part_green), **options) as server, page(server) as client:
            await client.receive("frame")
            await client.say(type="model", name="beam")
            whole = 3 * len(built.bodies[0].green.touchable_nodes)
            while True:
                message, _ = await client.receive("computed")
                if message["bodies"][0]["done"] == whole:
                    break
            assert growing.is_closed and message["bodies"][0]["columns"] == whole

    asyncio.run(session())


class FailingFill(setting_up.FillProcess):
    """Reads and draws a file, and fails a moment later."""

    def mesh(self, wanted):
        on_read = self.on_read

        def read_and_fail(read):
            on_read(read)
            time.sleep(0.3)
            raise MeshError(f"{self.file}: cannot be filled")

        self.on_read = read_and_fail
        return super().mesh(wanted)


def test_a_file_that_fails_gives_the_session_before_back_with_its_tool_out(built, ball, monkeypatch):
    monkeypatch.setattr(setting_up, "FillProcess", FailingFill)

    async def session():
        async with serving(built) as server, page(server) as client:
            before = server.session
            await client.receive("frame")
            await client.say(**PRESS)
            await client.frame_where(lambda header: header["contacts"])
            await send(client, "ball.stl", ball.read_bytes())
            error, _ = await client.receive("error")
            assert "cannot be filled" in error["text"]
            await until(lambda: not server.is_building)
            assert server.session is before
            header, _ = await client.receive("frame")
            assert not header["tools"][0]["active"] and not header["contacts"]
            await client.say(**PRESS)
            await client.frame_where(lambda header: header["contacts"])

    asyncio.run(session())


def test_a_device_that_is_gone_leaves_the_session_before_to_the_pointer(built, ball, monkeypatch):
    monkeypatch.setattr(setting_up, "FillProcess", FailingFill)

    def gone(_simulation):
        raise DeviceError("tool 0: no device there")

    async def session():
        async with serving(built) as server, page(server) as client:
            before = server.session
            await client.receive("frame")
            monkeypatch.setattr(Simulation, "start", gone)
            await send(client, "ball.stl", ball.read_bytes())
            error, _ = await client.receive("error")
            assert "cannot be filled" in error["text"]
            await until(lambda: server.session is before)
            await client.receive("frame")

    asyncio.run(session())


@pytest.mark.slow
def test_a_file_cancelled_while_it_is_drawn_leaves_the_session_before(built, ball, monkeypatch):
    close = Session.close

    def slow(session):
        time.sleep(0.5)
        close(session)

    async def session():
        async with serving(built) as server, page(server) as client:
            before = server.session
            await client.receive("frame")
            monkeypatch.setattr(Session, "close", slow)
            await send(client, "ball.stl", ball.read_bytes())
            await until(lambda: server._setting_up._body is not None)
            await client.say(type="cancel")
            error, _ = await client.receive("error")
            assert error["text"].startswith("cancelled")
            await until(lambda: not server.is_building)
            assert server.session is before and server._setting_up._body is None
            await client.receive("frame")

    asyncio.run(session())


@pytest.mark.slow
def test_a_touch_that_is_cancelled_late_ends_what_computes_its_columns(built, ball, saves, block_green, monkeypatch):
    growing, asked = StubGrowing(block_green), threading.Event()

    class First:
        def __init__(self, _scene):
            pass

        def build_first(self, _progress):
            asked.set()
            time.sleep(0.5)
            return built, {0: growing}

    monkeypatch.setattr(setting_up, "_with_first", First)

    async def session():
        async with empty_page(saves) as (_, client):
            await filled(client, ball)
            await client.say(type="setup", unit="mm")
            await client.say(type="touch")
            await until(asked.is_set)
            await client.say(type="cancel")
            error, _ = await client.receive("error")
            assert error["text"].startswith("cancelled")
            await until(lambda: growing.is_closed)

    asyncio.run(session())


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"type": "upload", "name": "骨" * 100 + ".stl", "size": 10}, "at most 120 bytes"),
        ({"type": "upload", "name": "a.stl", "size": 10**400}, "the page takes files up to 200 MB"),
    ],
)
def test_announcements_that_make_no_sense_are_answered(saves, message, words):
    async def session():
        async with empty_page(saves) as (_, client):
            await client.say(**message)
            error, _ = await client.receive("error")
            assert words in error["text"] and len(error["text"]) < 200
            await client.say(type="upload", name="a.stl", size=10)
            await client.receive("uploaded")

    asyncio.run(session())


def test_a_full_disk_is_a_message_and_parts_given_up_leave_nothing(saves, monkeypatch):
    async def session():
        async with empty_page(saves) as (server, client):
            for _ in range(3):
                await client.say(type="upload", name="a.stl", size=10)
                await client.receive("uploaded")
            assert len(list(server._setting_up._temporary.iterdir())) == 1

            def full(*_arguments):
                raise OSError(28, "No space left on device")

            monkeypatch.setattr(setting_up, "Upload", full)
            await client.say(type="upload", name="a.stl", size=10)
            error, _ = await client.receive("error")
            assert "No space left on device" in error["text"]
            # A mistake of the program gets an answer too, and the page stays connected.
            monkeypatch.setattr(setting_up, "Upload", lambda *_: 1 / 0)
            await client.say(type="upload", name="a.stl", size=10)
            error, _ = await client.receive("error")
            assert "please report it: ZeroDivisionError" in error["text"]
            await client.say(type="edit")
            await client.receive("error")

    asyncio.run(session())


@pytest.mark.slow
def test_segments_without_a_name_are_refused(ball, saves):
    async def session():
        async with empty_page(saves) as (_, client):
            await filled(client, ball)
            await client.say(type="setup", segments=[{}])
            error, _ = await client.receive("error")
            assert error["text"].startswith("setup: segments: name")

    asyncio.run(session())


def test_a_value_that_is_refused_beside_one_that_is_not(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            await client.say(type="set", friction=0.25, contact_radius=-1.0)
            settings, _ = await client.receive("settings")
            assert settings["friction"] == server.session.settings()["friction"]

    asyncio.run(session())


def test_a_page_that_opens_during_a_long_work_sees_it(built):
    async def session():
        async with serving(built) as server:
            server.send_all({"type": "status", "text": "Solving", "progress": None, "left_s": None})
            async with page(server) as client:
                status, _ = await client.receive("status")
                assert status["text"] == "Solving"
            server.finish_building()
            assert server._status is None

    asyncio.run(session())


def test_a_watch_that_fails_is_logged_once_and_goes_on(built, caplog, monkeypatch):
    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("computed")
            step, failing = server._computing.step, [True]

            def failing_step(shown):
                if failing[0]:
                    raise RuntimeError("of a test")
                server._computing._last_message = None
                return step(shown)

            monkeypatch.setattr(server._computing, "step", failing_step)
            await asyncio.sleep(1.0)
            failing[0] = False
            await client.receive("computed")

    with caplog.at_level(logging.ERROR):
        asyncio.run(session())
    assert len([record for record in caplog.records if "palpate" in record.message]) == 1


def test_a_server_that_stops_during_a_long_work_says_nothing(built, caplog):
    asked = threading.Event()

    class Model:
        def build(self, *_reporters):
            asked.set()
            time.sleep(0.5)
            raise ViewerError("too late")

    async def session():
        async with serving(built, models=["a"], scene_of=lambda _: Model()) as server, page(server) as client:
            await client.receive("frame")
            await client.say(type="model", name="a")
            await until(asked.is_set)
        assert not server.is_building

    with caplog.at_level(logging.ERROR):
        asyncio.run(session())
    assert not [record for record in caplog.records if record.name == "asyncio"]
