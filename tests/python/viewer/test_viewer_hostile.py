"""What no page would send: refused without an error in the server's log. And the addresses that a server prints."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import urllib.request

import pytest
import websockets
from viewer_client import page, serving
from websockets.asyncio.client import connect

import palpate
from palpate.scene import BuiltScene
from palpate.viewer import messages
from palpate.viewer.pages import reachable
from palpate.viewer.server import BAD_TOKEN, ViewerServer


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"contact": "patch"})
    return BuiltScene.of(scene, block, block_green)


def errors_in(caplog) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelname in ("ERROR", "CRITICAL")]


@pytest.mark.parametrize("token", ["\\ud800", "\\udfff\\ud800", "\\u0000", "ünïcode"])
def test_a_token_of_any_text_is_only_wrong(built, token, caplog):
    async def session():
        async with serving(built) as server:
            base = f"127.0.0.1:{server.port}"
            async with connect(f"ws://{base}/socket", origin=f"http://{base}", proxy=None) as socket_:
                await socket_.send(f'{{"type": "hello", "version": {messages.VERSION}, "token": "{token}"}}')
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await socket_.recv()
                assert closed.value.rcvd.code == BAD_TOKEN
            async with page(server) as client:
                await client.receive("scene")

    asyncio.run(session())
    assert errors_in(caplog) == []


async def raw_answer(port: int, head: list[str]) -> str:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write("\r\n".join([*head, "", ""]).encode())
    await writer.drain()
    line = await asyncio.wait_for(reader.readline(), 5)
    writer.close()
    await writer.wait_closed()
    return line.decode()


def test_a_header_that_stands_there_twice_is_refused(built, caplog):
    async def session():
        async with serving(built) as server:
            host = f"Host: 127.0.0.1:{server.port}"
            upgrade = [
                *("GET /socket HTTP/1.1", host, "Upgrade: websocket", "Connection: Upgrade"),
                *("Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13"),
            ]
            origin = f"Origin: http://127.0.0.1:{server.port}"
            assert "200" in await raw_answer(server.port, ["GET / HTTP/1.1", host])
            assert "101" in await raw_answer(server.port, [*upgrade, origin])
            for other in (host, "Host: evil.example"):
                assert "403" in await raw_answer(server.port, ["GET / HTTP/1.1", host, other])
            assert "403" in await raw_answer(server.port, [*upgrade, origin, "Origin: http://evil.example"])

    asyncio.run(session())
    assert errors_in(caplog) == []


@pytest.mark.parametrize("digits", [309, 400, 4000])
def test_a_whole_number_beyond_floats_is_refused_like_any_other(built, digits, caplog):
    big = "9" * digits

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            for text in (
                f'{{"type": "set", "friction": {big}}}',
                f'{{"type": "press", "tool": 0, "position": [{big[:3900]}, 0, 0]}}',
                f'{{"type": "press", "tool": {big}, "position": [0, 0, 0]}}',
            ):
                await client.socket.send(text)
                error, _ = await client.receive("error")
                assert "number" in error["text"] and len(error["text"]) < 200
            await client.say(type="ack", frame=int(big))
            await client.receive("frame")

    asyncio.run(session())
    assert errors_in(caplog) == []


def test_names_with_half_a_surrogate_pair_are_answered(built, caplog):
    async def session():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            for kind in ("model", "field", "\\ud800", "shape"):
                await client.socket.send(f'{{"type": "{kind}", "tool": 0, "name": "\\ud800"}}')
                if kind != "field":
                    await client.receive("error")
            await client.receive("frame")

    asyncio.run(session())
    assert errors_in(caplog) == []


def test_a_server_bound_to_every_address_names_those_to_open(built):
    hosts = reachable("0.0.0.0")
    assert hosts[0] == "127.0.0.1" and len(set(hosts)) == len(hosts)
    assert all(not ipaddress.ip_address(host).is_loopback for host in hosts[1:])
    assert reachable("::")[0] == "::1" and reachable("192.168.1.5") == ["192.168.1.5"]

    def opened(address):
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(address.partition("#")[0], timeout=5) as answer:
            return answer.status

    async def session():
        async with serving(built, host="0.0.0.0") as server:
            assert len(server.addresses) == len(hosts) and server.address == server.addresses[0]
            for address in server.addresses:
                assert address.endswith(f"#token={server.token}")
                assert await asyncio.to_thread(opened, address) == 200

    asyncio.run(session())


def test_addresses_of_the_newer_protocol_stand_in_brackets(built):
    if not socket.has_ipv6:
        pytest.skip("this machine has no IPv6")
    server = ViewerServer(built, host="::1", port=8642)
    assert server.address.startswith("http://[::1]:8642/#token=")
    server._close_session()
