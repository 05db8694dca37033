"""A client of the viewer's server that speaks the page's protocol."""

from __future__ import annotations

import asyncio
import contextlib
import json

import numpy as np
from websockets.asyncio.client import connect

from palpate.viewer import messages
from palpate.viewer.server import ViewerServer


class Page:
    """A client that speaks the page's protocol."""

    def __init__(self, server: ViewerServer, socket):
        self.server, self.socket = server, socket
        self.texts: list[dict] = []

    async def say(self, **message):
        await self.socket.send(json.dumps(message))

    async def receive(self, kind: str, limit: float = 5.0):
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
                if header["type"] == kind:
                    return header, arrays

        return await asyncio.wait_for(wait(), limit)

    async def frame_where(self, condition):
        for _ in range(400):
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
    """Frame once the hand has arrived: the force stands still but for what a tick leaves open, 1e-7 of it."""
    force = [np.inf] * 3
    for _ in range(200):
        header, arrays = await client.receive("frame")
        before, force = force, header["tools"][0]["force"]
        if header["contacts"] and np.allclose(force, before, rtol=1e-5, atol=1e-7) and condition(header):
            return header, arrays
    raise AssertionError(f"the force does not settle; the last frame was {header}")
