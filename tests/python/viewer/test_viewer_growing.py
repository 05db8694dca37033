"""A page on a body whose columns are still computed."""

from __future__ import annotations

import asyncio
import base64
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import box_mesh
from viewer_client import page, serving

import palpate
from palpate.mesh import TetMesh
from palpate.viewer.computing import Computing

SIDE = 0.06


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> palpate.Scene:
    folder = tmp_path_factory.mktemp("growing")
    mesh = box_mesh((16, 16, 12), (SIDE, SIDE, SIDE), jitter=0.0)
    TetMesh(mesh.nodes, mesh.tets).write(folder / "cube.vtu")
    text = """
body = { mesh = "cube.vtu", unit = "m", precision = "f16" }
supports = { fixed = "z < 1mm" }
touch = { first = { shape = "box", low = [0.04, 0.04, 0.055], high = [1.0, 1.0, 1.0] } }
tool = { radius = "6mm" }
device = { priority = 0 }
"""
    (folder / "cube.toml").write_text(text)
    return palpate.Scene.read(folder / "cube.toml")


def nodes_of(mask: str) -> np.ndarray:
    return np.flatnonzero(np.unpackbits(np.frombuffer(base64.b64decode(mask), np.uint8), bitorder="little"))


def test_a_scene_of_another_number_of_bodies_is_another_message(block_green):
    """It may come before what is computed of it is followed."""

    def shown(*greens) -> SimpleNamespace:
        return SimpleNamespace(built=SimpleNamespace(bodies=[SimpleNamespace(green=green) for green in greens]))

    computing = Computing()
    assert computing.step(shown())["bodies"] == []
    (entry,) = computing.step(shown(block_green))["bodies"]
    assert entry["done"] == entry["columns"] == 3 * len(block_green.touchable_nodes)
    assert computing.step(shown(block_green)) is None


@pytest.mark.slow
def test_the_page_is_told_what_is_ready_and_what_it_paints_comes_next(scene):
    built, growing = scene.build_first(progress=False)
    green = built.bodies[0].green
    first = np.flatnonzero(np.isin(green.surface_nodes, green.touchable_nodes))
    positions = green.surface_positions
    assert len(first) < len(positions)

    async def run():
        async with serving(built, growing=growing) as server, page(server) as client:
            message, _ = await client.receive("computed")
            entry = message["bodies"][0]
            assert np.isin(first, nodes_of(entry["ready"])).all() and entry["columns"] == 3 * len(positions)
            corner = (positions < [0.02, 0.02, 1.0]).all(axis=1) & (positions[:, 2] > 0.055)
            mask = base64.b64encode(np.packbits(corner, bitorder="little").tobytes()).decode()
            await client.say(type="paint", body=0, first=0, nodes=mask)
            wanted = np.flatnonzero(corner)
            while entry["ready"] is not None and not np.isin(wanted, nodes_of(entry["ready"])).all():
                message, _ = await client.receive("computed")
                entry = message["bodies"][0]
                assert entry["stopped"] is None
            while entry["ready"] is not None:
                message, _ = await client.receive("computed")
                entry = message["bodies"][0]
            assert entry["done"] == entry["columns"] and entry["waiting"] is None
            # Then the series of the complete body is computed, and none before.
            while message["series"] is None:
                message, _ = await client.receive("computed")
            while message["series"] is not None:
                assert message["series"]["stopped"] is None
                message, _ = await client.receive("computed")
            ((_, known),) = scene.build(progress=False).bodies[0].series
            assert known is not None and known.is_complete
            # The loop has taken the store: the corner far from what came first can be pressed.
            await client.say(type="press", tool=0, position=[0.01, 0.01, SIDE + 0.02], grab=False)
            await client.frame_where(lambda header: header["tools"][0]["active"])
            await client.say(type="press", tool=0, position=[0.012, 0.012, SIDE + 0.006 - 0.002], grab=False)
            header, _ = await client.frame_where(lambda header: header["contacts"])
            assert header["fault"] is None
            for wrong in ({"nodes": mask}, {"nodes": "?", "first": 0}, {"nodes": mask, "first": 10**6}):
                await client.say(type="paint", body=0, **wrong)
                refused, _ = await client.receive("error")
                assert refused["text"].startswith("paint: ")

    asyncio.run(run())


@pytest.mark.slow
def test_a_mask_that_is_none_is_refused_while_columns_are_computed(scene, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    built, growing = scene.build_first(progress=False)

    async def run():
        async with serving(built, growing=growing) as server, page(server) as client:
            for wrong in ({"nodes": "?", "first": 0}, {"nodes": "AQ==", "first": 3}, {"nodes": "AA==", "first": 0}, {}):
                await client.say(type="paint", body=0, **wrong)
                refused, _ = await client.receive("error")
                assert refused["text"].startswith("paint: ")

    asyncio.run(run())


def test_the_page_says_how_far_the_series_are_and_the_loop_has_them_then(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    mesh = box_mesh((6, 6, 6), (SIDE, SIDE, SIDE), jitter=0.0)
    mesh.write(tmp_path / "cube.vtu")
    table = {"mesh": str(tmp_path / "cube.vtu"), "unit": "m"}
    scene = palpate.Scene(body=table, supports={"fixed": "z < 1mm"}, tool=[{"radius": "6mm"}])
    built = scene.build(progress=False)
    assert [known for _, known in built.bodies[0].series] == [None]

    async def run():
        async with serving(built) as server, page(server) as client:
            seen = []
            while not seen or seen[-1] is not None:
                message, _ = await client.receive("computed")
                seen.append(message["series"])
            assert seen[0] is not None and all(entry["stopped"] is None for entry in seen[:-1])
            assert all(entry["done"] <= entry["places"] for entry in seen[:-1])

    asyncio.run(run())
    assert [known.is_complete for _, known in scene.build(progress=False).bodies[0].series] == [True]
