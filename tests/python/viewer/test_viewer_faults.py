"""Whatever becomes of those who look on, the force loop goes on as before."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from viewer_client import page, serving

import palpate
from palpate.scene import BuiltScene

CLIENTS = 10


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    return BuiltScene.of(palpate.Scene(body={"model": "beam"}, tool={"radius": "5mm"}), block, block_green)


def test_ten_clients_slow_and_killed_ones(built):
    """One never answers, one is cut off within a press, the others go on; the loop has ticked all the while."""

    async def session():
        async with serving(built) as server, contextlib.AsyncExitStack() as stack:
            clients = [await stack.enter_async_context(page(server)) for _ in range(CLIENTS)]
            controller, silent, cut, *others = clients
            await controller.frame_where(lambda header: True)
            # The silent one takes its first frame and never acknowledges it.
            while not isinstance(await silent.socket.recv(), bytes):
                pass
            await controller.say(type="press", tool=0, position=[0.09, 0.025, 0.025], grab=False)
            await controller.receive("frame")
            await controller.say(type="press", tool=0, position=[0.083, 0.025, 0.025], grab=False)
            pressed, _ = await controller.frame_where(lambda header: len(header["contacts"]) > 0)
            cut.socket.transport.abort()
            for client in others:
                await client.frame_where(lambda header: len(header["contacts"]) > 0)
            later, _ = await controller.frame_where(lambda header: header["time"] > pressed["time"] + 0.5)
            ticks = later["ticks"] - pressed["ticks"]
            missed = later["missed_deadlines"] - pressed["missed_deadlines"]
            # Every deadline was met or is counted as missed.
            assert abs(ticks + missed - 1000 * (later["time"] - pressed["time"])) < 20
            assert later["fault"] is None
            # The one who presses is killed: nothing is held any more.
            controller.socket.transport.abort()
            await others[0].frame_where(lambda header: len(header["contacts"]) == 0)

    asyncio.run(session())


def test_a_fault_is_told_with_its_reason_and_cleared_by_a_reset(built):
    """A force that is no number, by a program that moves a tool nowhere."""

    async def session():
        async with serving(built) as server, page(server) as client:
            await client.frame_where(lambda header: True)
            # Beyond the checks of the server, as a driver would.
            core = server._session.simulation._core
            core.set_target(0, ((float("nan"), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), (0.0, 0.0, 0.0), True, False)
            message, _ = await client.frame_where(lambda header: header["fault"] is not None)
            assert message["fault"].startswith("tool 0: the device reported a position that is not finite")
            assert message["tools"][0]["force"] == [0, 0, 0]
            core.set_target(0, ((0.2, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), (0.0, 0.0, 0.0), True, False)
            await client.say(type="reset")
            await client.frame_where(lambda header: header["fault"] is None)

    asyncio.run(session())
