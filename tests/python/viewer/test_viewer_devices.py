"""A tool that a device moves, as the page sees it: felt, not driven by the pointer, let go of when the device goes."""

from __future__ import annotations

import asyncio
import warnings

from emulators import inverse_service
from viewer_client import page, serving

import palpate
from palpate.scene import BuiltScene


def test_a_device_is_shown_and_its_fault_told(block, block_green):
    async def session(built, process):
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert [tool["device"] for tool in scene["tools"]] == ["Haply Inverse3 0A01", None]
            felt, _ = await client.frame_where(lambda header: header["tools"][0]["force"][2] > 0.02)
            assert [tool["active"] for tool in felt["tools"]] == [True, False] and felt["contacts"][0]["tool"] == 0
            await client.say(type="press", tool=0, position=[0.04, 0.025, 0.06], grab=False)
            notice, _ = await client.receive("error")
            assert notice["text"] == "press: tool 0 is moved by Haply Inverse3 0A01"
            # The pointer has the other one, and presses deeper than the device bends the block.
            await client.say(type="press", tool=1, position=[0.06, 0.025, 0.044], grab=False)
            await client.frame_where(lambda header: header["tools"][1]["force"][2] > 0.0)
            process.kill()
            gone, _ = await client.frame_where(lambda header: header["fault"] is not None)
            assert gone["fault"].startswith("tool 0: the device is disconnected: connect it again")
            assert gone["tools"][0]["force"] == [0, 0, 0] and gone["tools"][1]["force"][2] > 0.0

    with inverse_service() as (address, process):
        device = {"kind": "haply", "address": address, "position": (0.025, 0.025, 0.056)}
        tools = [{"radius": "6mm"}, {"radius": "6mm"}]
        scene = palpate.Scene(body={"model": "beam"}, tool=tools, device=device)
        with warnings.catch_warnings(record=True, action="always") as record:
            asyncio.run(session(BuiltScene.of(scene, block, block_green), process))
    limited = [str(one.message) for one in record if issubclass(one.category, palpate.DeviceWarning)]
    holds = "tool 0: Haply Inverse3 0A01 renders contacts up to 800 N/m, and this scene has up to 5000"
    assert [line.rpartition(": ")[0] for line in limited] == [holds]


def test_a_change_of_tool_that_fails_leaves_the_scene_as_it_was(block, block_green):
    """A device unplugged while another tool gets its shape: the page is told, and its frames go on."""

    async def session(built, process):
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            assert [tool["device"] for tool in scene["tools"]] == ["Haply Inverse3 0A01", None]
            process.kill()
            await client.say(type="shape", tool=1, name="punch")
            notice, _ = await client.receive("error")
            assert "Haply" in notice["text"] and notice["text"].endswith("; the scene shown before stays")
            again, _ = await client.receive("scene")
            assert [tool["shape"] for tool in again["tools"]] == ["sphere", "sphere"]
            assert [tool["device"] for tool in again["tools"]] == [None, None]
            for tool in (0, 1):
                place = [0.03 + 0.03 * tool, 0.025, 0.05]
                await client.say(type="press", tool=tool, position=place, grab=False)
                await client.frame_where(lambda header, tool=tool: header["tools"][tool]["force"][2] > 0.02)

    with inverse_service() as (address, process):
        device = {"kind": "haply", "address": address, "position": (0.025, 0.025, 0.056)}
        scene = palpate.Scene(body={"model": "beam"}, tool=[{"radius": "6mm"}, {"radius": "6mm"}], device=device)
        with warnings.catch_warnings(action="ignore", category=palpate.DeviceWarning):
            asyncio.run(session(BuiltScene.of(scene, block, block_green), process))
