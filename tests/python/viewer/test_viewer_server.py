"""The viewer's server: who gets in, who controls, what bad clients may do."""

from __future__ import annotations

import asyncio
import json
import socket
import urllib.request
from urllib.error import HTTPError

import numpy as np
import pytest
import websockets
from viewer_client import page, serving
from websockets.asyncio.client import connect

import palpate
from palpate.scene import BuiltScene
from palpate.viewer import messages
from palpate.viewer.pages import is_own_host
from palpate.viewer.server import MAX_MESSAGE, ViewerServer

TOP = [0.04, 0.025, 0.05]


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    """With the law of the patch, which an answer of the Green's function can be compared with."""
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"contact": "patch"})
    return BuiltScene.of(scene, block, block_green)


def get(server, path="/", host=None):
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", headers={"Host": host} if host else {})
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(request, timeout=5) as answer:
        return answer.status, dict(answer.headers), answer.read()


def test_a_press_is_felt_and_released(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            welcome, _ = await client.receive("welcome")
            assert welcome["role"] == "control"
            scene, arrays = await client.receive("scene")
            assert np.allclose(arrays["0/nodes"], built.bodies[0].body.mesh.nodes, atol=1e-8)
            assert np.array_equal(arrays["0/tets"], built.bodies[0].body.mesh.tets)
            assert np.array_equal(arrays["0/fixed_nodes"], built.bodies[0].body.fixed_nodes)
            radius = scene["tools"][0]["radius"]
            deep = [TOP[0], TOP[1], TOP[2] + radius - 2e-3]
            await client.say(type="press", tool=0, position=[TOP[0], TOP[1], TOP[2] + radius + 1e-3], grab=False)
            await client.receive("frame")
            await client.say(type="press", tool=0, position=deep, grab=False)
            await client.say(type="cutaway", on=True)
            # The hand needs some tens of milliseconds to get there, the ramp a quarter of a second.
            settled = lambda h: h["time"] > 0.6 and h["tools"][0]["position"][2] < deep[2] + 1e-6 and h["interior"][0]  # noqa: E731
            header, arrays = await client.frame_where(settled)
            expected = built.bodies[0].green.touch(TOP, (0, 0, -2e-3), scene["tools"][0]["contact_radius"])
            assert np.allclose(header["tools"][0]["force"], -expected.force, rtol=1e-3, atol=1e-4)
            assert header["tools"][0]["force"][2] > 0 > header["contacts"][0]["force"][2]
            surface = arrays["0/displacements"][built.bodies[0].green.surface_nodes]
            assert np.allclose(surface, expected.displacements, atol=1e-6)
            assert len(arrays["0/displacements"]) == scene["bodies"][0]["nodes"]
            assert arrays["0/scalar"].max() == 255
            assert len(arrays["log"]) > 0
            await client.say(type="release")
            header, _ = await client.frame_where(lambda h: h["tools"][0]["force"] == [0, 0, 0])
            assert header["contacts"] == []

    asyncio.run(session())


def test_sliders_act_at_once_and_are_told_to_all(built):
    async def session():
        async with serving(built) as server, page(server) as client, page(server) as watcher:
            await watcher.receive("welcome")
            await client.say(type="set", body=0, youngs_modulus=20e3)
            settings, _ = await watcher.receive("settings")
            assert settings["youngs_modulus"][0] == 20e3
            # Who comes now is told what it is, and what Reset leads to.
            async with page(server) as late:
                scene, _ = await late.receive("scene")
                assert scene["bodies"][0]["youngs_modulus"] == 20e3
                assert scene["defaults"]["youngs_modulus"] == [pytest.approx(10e3)]
                assert scene["defaults"]["friction"] == [0.3] and scene["defaults"]["strain_limit"] == 0.3
            await client.say(type="set", body=0, youngs_modulus=-1)
            error, _ = await client.receive("error")
            assert "positive" in error["text"]
            for key, value in {"friction": 0.8, "strain_limit": 0.25}.items():
                await client.say(type="set", **{key: value})
                settings, _ = await client.receive("settings")
                assert settings[key] in (value, [value])
            simulation = server._session.simulation
            assert simulation.friction_of() == 0.8
            await client.say(type="reset")
            settings, _ = await client.receive("settings")
            assert settings["youngs_modulus"][0] == pytest.approx(10e3)
            assert settings["friction"] == [0.3] and settings["strain_limit"] == 0.3
            assert simulation.friction_of() == 0.3

    asyncio.run(session())


def test_watchers_watch_and_take_over(built):
    async def session():
        async with serving(built) as server:
            async with page(server) as first:
                await first.receive("scene")
                await first.say(type="press", tool=0, position=[TOP[0], TOP[1], TOP[2]], grab=False)
                async with page(server) as second:
                    welcome, _ = await second.receive("welcome")
                    assert welcome["role"] == "watch"
                    await second.say(type="press", tool=0, position=TOP, grab=False)
                    error, _ = await second.receive("error")
                    assert "control" in error["text"]
                    await second.frame_where(lambda h: len(h["contacts"]) == 1)
                    await first.socket.close()
                    role, _ = await second.receive("role")
                    assert role["role"] == "control"
                    # The contact of the page that left is let go.
                    await second.frame_where(lambda h: h["contacts"] == [] and h["tools"][0]["force"] == [0, 0, 0])

    asyncio.run(session())


def test_a_silent_controller_lets_go(built, monkeypatch):
    monkeypatch.setattr("palpate.viewer.server.LOST_AFTER", 1.0)

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            await client.say(type="press", tool=0, position=TOP, grab=False)
            await client.frame_where(lambda h: len(h["contacts"]) == 1)
            await asyncio.sleep(2.0)  # no acknowledgement, no pointer
            header, _ = await client.frame_where(lambda h: h["contacts"] == [])
            assert not header["tools"][0]["active"]

    asyncio.run(session())


@pytest.mark.parametrize("token", ["wrong", "", None, 5])
def test_without_the_token_nobody_gets_in(built, token):
    async def session():
        async with serving(built) as server:
            base = f"127.0.0.1:{server.port}"
            async with connect(f"ws://{base}/socket", origin=f"http://{base}", proxy=None) as socket:
                await socket.send(json.dumps({"type": "hello", "token": token, "version": 1}))
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await socket.recv()
                assert closed.value.rcvd.code == 4401

    asyncio.run(session())


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1", "https://127.0.0.1:{port}"])
def test_another_origin_cannot_open_the_socket(built, origin):
    async def session():
        async with serving(built) as server:
            with pytest.raises(websockets.InvalidStatus, match="403"):
                async with page(server, origin=origin.format(port=server.port)):
                    pass

    asyncio.run(session())


def test_another_host_gets_nothing(built):
    async def session():
        async with serving(built) as server:
            with pytest.raises(HTTPError, match="403"):
                await asyncio.to_thread(get, server, "/", "evil.example")
            with pytest.raises(HTTPError, match="403"):
                await asyncio.to_thread(get, server, "/", f"evil.example:{server.port}")
            status, headers, content = await asyncio.to_thread(get, server)
            assert status == 200 and b"<!doctype html>" in content.lower()
            assert "default-src 'self'" in headers["Content-Security-Policy"]
            assert server.token.encode() not in content
            for path in ("/../server.py", "/%2e%2e/server.py", "/server.py", "/index.html/"):
                with pytest.raises(HTTPError, match="404"):
                    await asyncio.to_thread(get, server, path)

    asyncio.run(session())


def test_it_listens_on_this_machine_only(built):
    async def session():
        async with serving(built) as server:
            assert [s.getsockname()[0] for s in server._server.sockets] == ["127.0.0.1"]

    asyncio.run(session())


@pytest.mark.parametrize(
    ("host", "bound", "ours"),
    [
        ("127.0.0.1:80", "127.0.0.1", True),
        ("localhost:80", "127.0.0.1", True),
        ("localhost", "127.0.0.1", True),
        ("[::1]:80", "::1", True),
        ("localhost:81", "127.0.0.1", False),
        ("192.168.1.5:80", "127.0.0.1", False),
        ("192.168.1.5:80", "0.0.0.0", True),
        ("evil.example:80", "0.0.0.0", False),
        ("127.0.0.1.evil.example:80", "127.0.0.1", False),
        (None, "127.0.0.1", False),
    ],
)
def test_host_header(host, bound, ours):
    assert is_own_host(host, bound, 80) is ours


@pytest.mark.parametrize(
    "text",
    [
        "nonsense",
        "[]",
        "{}",
        '{"type": 5}',
        '{"type": "press"}',
        '{"type": "press", "position": [0, 0, 0]}',
        '{"type": "press", "tool": 1, "position": [0, 0, 0]}',
        '{"type": "press", "tool": -1, "position": [0, 0, 0]}',
        '{"type": "press", "tool": "first", "position": [0, 0, 0]}',
        '{"type": "release", "tool": 1}',
        '{"type": "press", "tool": 0, "position": [0, 0]}',
        '{"type": "press", "tool": 0, "position": [NaN, 0, 0]}',
        '{"type": "press", "tool": 0, "position": [1e300, 0, 0]}',
        '{"type": "press", "tool": 0, "position": [0, 0, 0], "grab": 1}',
        '{"type": "set"}',
        '{"type": "set", "body": 0, "youngs_modulus": "soft"}',
        '{"type": "set", "contact_radius": 1e9}',
        '{"type": "set", "friction": -0.1}',
        '{"type": "set", "friction": 0.3, "tool": 1}',
        '{"type": "set", "strain_limit": 1.5}',
        '{"type": "set", "strain_limit": null}',
        '{"type": "set", "contact_radius": 0.004, "tool": 1}',
        '{"type": "set", "youngs_modulus": 1e4}',
        '{"type": "field", "name": "displacement", "max": 0}',
        '{"type": "field", "name": "displacement", "max": "1 mm"}',
        '{"type": "set", "youngs_modulus": 1e4, "body": 1}',
        '{"type": "set", "body": 0, "tool": 0}',
        '{"type": "set", "token": 1}',
        '{"type": "model", "name": "spleen"}',
        '{"type": "shape", "tool": 0, "name": "banana"}',
        '{"type": "shape", "tool": 1, "name": "sphere"}',
        '{"type": "shape", "tool": 0}',
        '{"type": "shutdown"}',
        "[" * 3000,
    ],
)
def test_bad_messages_are_refused_and_the_session_goes_on(built, text):
    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            await client.socket.send(text)
            error, _ = await client.receive("error")
            assert error["text"]
            await client.receive("frame")

    asyncio.run(session())


def test_messages_are_bounded_in_size_and_rate(built):
    async def session():
        async with serving(built) as server:
            async with page(server) as client:
                await client.receive("scene")
                await client.socket.send(" " * (MAX_MESSAGE + 1))
                with pytest.raises(websockets.ConnectionClosed):
                    await client.receive("never")
            async with page(server) as client:
                await client.receive("scene")
                with pytest.raises(websockets.ConnectionClosed):
                    for _ in range(20_000):
                        await client.say(type="release")
                    await client.receive("never")
            async with page(server) as client:
                await client.receive("scene")

    asyncio.run(session())


def test_frames_wait_for_the_client(built):
    """A client that acknowledges nothing gets one frame, not a queue."""

    async def session():
        async with serving(built) as server, page(server) as client:
            received = []

            async def take():
                while True:
                    raw = await client.socket.recv()
                    if isinstance(raw, bytes):
                        received.append(messages.decode(raw)[0]["type"])

            taking = asyncio.create_task(take())
            while len(received) < 2 and not taking.done():
                await asyncio.sleep(0.02)
            await asyncio.sleep(0.5)
            taking.cancel()
            assert received == ["scene", "frame"]

    asyncio.run(session())


def test_a_port_in_use_is_said(built):
    async def session():
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen()
            port = other.getsockname()[1]
            server = ViewerServer(built, port=port)
            with pytest.raises(palpate.ViewerError, match=f"port {port} .* in use.*--port"):
                await server.start()

    asyncio.run(session())
