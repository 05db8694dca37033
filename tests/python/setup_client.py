"""What a page does to set up a body: a file in parts, choices, and the loop that touches it."""

from __future__ import annotations

import contextlib

from viewer_client import page, serving


async def send(client, name: str, content: bytes, part: int = 100_000) -> None:
    """Send a file as the page does: the next part follows the answer to the one before."""
    await client.say(type="upload", name=name, size=len(content))
    for start in range(0, len(content), part):
        await client.receive("uploaded")
        await client.socket.send(content[start : start + part])
    await client.receive("uploaded")


async def setup_where(client, condition) -> dict:
    while True:
        message, _ = await client.receive("setup")
        if condition(message):
            return message


async def scene_where(client, condition):
    while True:
        header, arrays = await client.receive("scene")
        if condition(header):
            return header, arrays


async def filled(client, path) -> dict:
    await send(client, path.name, path.read_bytes())
    return (await setup_where(client, lambda m: m["body"] and m["body"]["filled"]))["body"]


@contextlib.asynccontextmanager
async def empty_page(saves):
    async with serving(None, recordings=saves) as server, page(server) as client:
        scene, _ = await client.receive("scene")
        assert scene["bodies"] == []
        yield server, client
