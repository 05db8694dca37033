"""A client of the viewer's server that speaks the page's protocol."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time

import numpy as np
from websockets.asyncio.client import connect

from palpate.viewer import messages
from palpate.viewer.fields import ClientView
from palpate.viewer.server import ViewerServer
from palpate.viewer.session import Session

# Frames come as fast as a busy machine lets them: a wait ends by what they hold, and fails only after this time, s.
PATIENCE = 60.0
# So far apart forces are compared, in ticks of the loop, which may be late too.
TICKS_APART = 15


def frame_of(session: Session, wants: ClientView) -> tuple[dict, dict[str, np.ndarray]]:
    """Header and arrays of a frame that a new client gets."""
    return messages.decode(session.frame_message(1, (0, 0), wants)[0])


class Page:
    """A client that speaks the page's protocol."""

    def __init__(self, server: ViewerServer, socket):
        self.server, self.socket = server, socket
        # The last message about what is computed beside the loop; it may come before the scene of which it is.
        self.computed: dict = {"bodies": []}

    async def say(self, **message):
        await self.socket.send(json.dumps(message))

    async def receive(self, kind: str, limit: float = PATIENCE):
        """Next message of a kind; binary frames are acknowledged as a page would."""

        async def wait():
            while True:
                raw = await self.socket.recv()
                if isinstance(raw, bytes):
                    header, arrays = messages.decode(raw)
                    if header["type"] == "frame":
                        await self.say(type="ack", frame=header["frame"])
                else:
                    header, arrays = json.loads(raw), {}
                    if header["type"] == "computed":
                        self.computed = header
                if header["type"] == kind:
                    return header, arrays

        return await asyncio.wait_for(wait(), limit)

    async def frame_where(self, condition):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            header, arrays = await self.receive("frame")
            if condition(header):
                return header, arrays
        raise AssertionError(f"no such frame came; the last was {header}")


@contextlib.asynccontextmanager
async def serving(built, **options):
    server = ViewerServer(built, port=0, **options)
    await server.start()
    try:
        yield server
    finally:
        await server.stop()


@contextlib.asynccontextmanager
async def page(server, *, token=None, origin=None):
    base = f"127.0.0.1:{server.port}"
    async with connect(f"ws://{base}/socket", origin=origin or f"http://{base}", proxy=None, max_size=None) as socket:
        client = Page(server, socket)
        await client.say(type="hello", token=token or server.token, version=messages.VERSION)
        yield client


async def settled(client, condition=lambda header: True):
    """Frame once the hand has arrived: the force stands still but for what ticks leave open, 1e-7 of it."""
    force, ticks, end = [np.inf] * 3, -np.inf, time.monotonic() + PATIENCE
    while time.monotonic() < end:
        header, arrays = await client.receive("frame")
        if header["ticks"] - ticks < TICKS_APART:
            continue
        before, force, ticks = force, header["tools"][0]["force"], header["ticks"]
        if header["contacts"] and np.allclose(force, before, rtol=1e-5, atol=1e-7) and condition(header):
            return header, arrays
    raise AssertionError(f"the force does not settle; the last frame was {header}")
