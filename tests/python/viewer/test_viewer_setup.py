"""A body that is set up in the page, as the server sees it: file, choices, loop, and the scene it is saved in."""

from __future__ import annotations

import asyncio
import base64

import numpy as np
import pytest
import trimesh
from setup_client import empty_page, filled, scene_where, send, setup_where
from viewer_client import page, serving, settled

import palpate
from palpate.body.tissues import TISSUES
from palpate.mesh import TetMesh
from palpate.scene.files import scene_text
from palpate.viewer import setting_up

# A ball of 80 mm: filled in a second.
RADIUS_MM = 40.0


@pytest.fixture
def ball(tmp_path):
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(3, RADIUS_MM).export(path)
    return path


@pytest.fixture
def saves(tmp_path):
    folder = tmp_path / "saves"
    folder.mkdir()
    return folder


def mask(nodes: np.ndarray) -> str:
    return base64.b64encode(np.packbits(nodes, bitorder="little").tobytes()).decode()


def test_a_file_is_read_and_filled_and_its_unit_is_asked_for(ball, saves):
    async def session():
        async with empty_page(saves) as (_, client):
            body = await filled(client, ball)
            assert body["unit"] is None and body["fitting"] == ["mm", "cm", "in"]
            sizes = {entry["unit"]: entry["size"] for entry in body["units"]}
            # Corners of the ball of triangles lie on the ball.
            assert np.allclose(sizes["mm"], 2e-3 * RADIUS_MM, rtol=1e-6)
            assert np.allclose(sizes["in"], 0.0254 * 2 * RADIUS_MM, rtol=1e-6)
            await client.say(type="touch")
            error, _ = await client.receive("error")
            assert "unit" in error["text"]
            await client.say(type="setup", unit="in")
            large = lambda scene: scene["size"] > 1  # noqa: E731
            scene, arrays = await scene_where(client, large)
            assert np.ptp(arrays["0/nodes"], axis=0) == pytest.approx(0.0254 * 2 * RADIUS_MM, rel=1e-2)
            assert scene["tools"] == []

    asyncio.run(session())


@pytest.mark.slow
def test_what_is_painted_is_touched_and_saved_and_runs_again_with_the_same_store(ball, saves, shared_cache):
    async def session():
        async with empty_page(saves) as (server, client):
            await filled(client, ball)
            await client.say(type="setup", unit="mm", painted=True, tissue="kidney", radius=6e-3)
            mesh = server._setting_up._body.mesh
            low = mesh.nodes[mesh.surface_nodes][:, 2] < -0.02
            await client.say(type="hold", first=0, nodes=mask(low))
            await client.say(type="touch")
            await scene_where(client, lambda scene: len(scene["tools"]) == 1)
            # The second loop has the series beyond small strain from the start.
            while not server.session.simulation.series.is_complete:
                await asyncio.sleep(0.05)
            top = [0.0, 0.0, 1e-3 * RADIUS_MM + 6e-3]
            await client.say(type="press", tool=0, position=[*top[:2], top[2] + 1e-3], grab=False)
            await client.receive("frame")
            await client.say(type="press", tool=0, position=[*top[:2], top[2] - 2e-3], grab=False)
            header, _ = await settled(client, lambda h: h["time"] > 0.6)
            force = np.array(header["tools"][0]["force"])
            await client.say(type="save")
            message = await setup_where(client, lambda m: m["body"]["saved"])
            assert message["body"]["saved"] == str(saves / "ball.toml") and not message["editing"]
            key = server.session.built.bodies[0].green.key
            held = np.array(mesh.surface_nodes)[low]
            return force, key, held

    force, key, held = asyncio.run(session())
    scene = palpate.Scene.read(saves / "ball.toml")
    tissue = next(tissue for tissue in TISSUES if tissue.name == "kidney")
    assert scene.material.youngs_modulus == tissue.youngs_modulus and tissue.source in scene.source[1]
    built = scene.build()
    assert built.bodies[0].green.key == key
    assert np.array_equal(np.unique(built.bodies[0].green.fixed_nodes), held)

    async def again():
        async with serving(built) as server, page(server) as client:
            await client.receive("scene")
            top = [0.0, 0.0, 1e-3 * RADIUS_MM + 6e-3]
            await client.say(type="press", tool=0, position=[*top[:2], top[2] + 1e-3], grab=False)
            await client.receive("frame")
            await client.say(type="press", tool=0, position=[*top[:2], top[2] - 2e-3], grab=False)
            header, _ = await settled(client, lambda h: h["time"] > 0.6)
            return np.array(header["tools"][0]["force"])

    # Friction keeps some 0.4 % of the force along the surface from the way there, which is another each time.
    assert asyncio.run(again())[2] == pytest.approx(force[2], rel=3e-4)
    assert force[2] > 0.02


@pytest.mark.slow
def test_a_plane_and_a_nodule_are_in_the_scene_and_nothing_is_written_over(ball, saves):
    async def session():
        async with empty_page(saves) as (_, client):
            await filled(client, ball)
            await client.say(type="setup", unit="mm", plane={"axis": 0, "above": True, "depth": 0.012})
            nodule = {"center": [0.0, 0.0, 0.01], "radius": 0.015, "youngs_modulus": 5e4}
            await client.say(type="setup", nodule=nodule)
            for name in ("ball", "ball-2"):
                await client.say(type="save")
                message = await setup_where(client, lambda m: m["body"]["saved"])
                assert message["body"]["saved"] == str(saves / f"{name}.toml")
            await client.say(type="setup", nodule={**nodule, "radius": 0.0005})
            await client.say(type="save")
            error, _ = await client.receive("error")
            assert "nodule" in error["text"]

    asyncio.run(session())
    scene = palpate.Scene.read(saves / "ball.toml")
    assert scene.supports.fixed == "x > max - 12mm"
    assert scene.region[0].radius == 0.015 and scene.region[0].youngs_modulus == 5e4
    assert sorted(path.name for path in saves.iterdir()) == ["ball-2.toml", "ball-2.vtu", "ball.toml", "ball.vtu"]


WRONG_FILES = [
    ("wrong.stl", b"no triangles here", "cannot be read as a surface"),
    ("wrong.xyz", b"1 2 3", "no surface, mesh or segmentation"),
    ("scene.toml", b"[body]", "palpate run"),
    ("../../flat.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "encloses"),
]


@pytest.mark.slow
def test_a_wrong_file_is_one_line_and_what_was_set_up_stays(ball, saves):
    async def session():
        async with empty_page(saves) as (server, client):
            before = await filled(client, ball)
            for name, content, reason in WRONG_FILES:
                await client.say(type="upload", name=name, size=len(content))
                if reason not in ("no surface, mesh or segmentation", "palpate run"):
                    await client.receive("uploaded")
                    await client.socket.send(content)
                error, _ = await client.receive("error")
                assert reason in error["text"] and "\n" not in error["text"] and "/tmp" not in error["text"]
                while server.is_building:
                    await asyncio.sleep(0.01)
                assert server._setting_up.message()["body"] == before, name
                assert server.session.body.read.file == "ball.stl"

    asyncio.run(session())


@pytest.mark.slow
def test_uploads_are_bounded_and_only_from_the_page_in_control(ball, saves):
    async def session():
        async with empty_page(saves) as (server, client), page(server) as watcher:
            await watcher.say(type="upload", name="ball.stl", size=100)
            assert "control" in (await watcher.receive("error"))[0]["text"]
            await watcher.socket.send(b"x" * 100)
            assert "control" in (await watcher.receive("error"))[0]["text"]
            await client.say(type="upload", name="ball.stl", size=setting_up.MAX_FILE + 1)
            assert "up to 200 MB" in (await client.receive("error"))[0]["text"]
            await client.socket.send(b"x")
            assert "announce" in (await client.receive("error"))[0]["text"]
            await client.say(type="upload", name="ball.stl", size=10)
            await client.receive("uploaded")
            await client.socket.send(b"x" * 11)
            assert "do not come to 10 bytes" in (await client.receive("error"))[0]["text"]
            # The page that was watching takes over from one that goes half-way.
            await client.say(type="upload", name="ball.stl", size=100)
            await client.receive("uploaded")
            await client.socket.close()
            await watcher.receive("role")
            await filled(watcher, ball)

    asyncio.run(session())


@pytest.mark.slow
def test_filling_is_cancelled_at_once_and_a_second_file_takes_the_place_of_the_first(ball, saves, tmp_path):
    other = tmp_path / "box.stl"
    trimesh.creation.box((30, 20, 10)).export(other)

    async def session():
        async with empty_page(saves) as (server, client):
            await send(client, ball.name, ball.read_bytes())
            await client.say(type="cancel")
            assert "cancelled" in (await client.receive("error"))[0]["text"]
            message = await setup_where(client, lambda m: m["editing"])
            assert message["body"] is None
            await filled(client, ball)
            body = await filled(client, other)
            assert body["name"] == "box" and np.allclose(sorted(body["size"]), [0.01, 0.02, 0.03])
            assert server.session.body.name == "box"

    asyncio.run(session())


CHOICES_WITHOUT_SENSE = [
    {"radius": 1.0},
    {"radius": "6mm"},
    {"tissue": "granite"},
    {"plane": {"axis": 3, "above": True, "depth": 0.01}},
    {"plane": {"axis": 1, "above": True, "depth": 10.0}},
    {"nodule": {"center": [1, 0, 0], "radius": 0.01, "youngs_modulus": 1e4}},
    {"nodule": {"center": [0, 0, 0], "radius": 0.01, "youngs_modulus": -1}},
    {"unit": "parsec"},
    {"name": "other"},
    {},
]


@pytest.mark.slow
def test_choices_that_make_no_sense_are_refused(ball, saves):
    async def session():
        async with empty_page(saves) as (server, client):
            await filled(client, ball)
            before = server._setting_up._body.choices
            for choice in CHOICES_WITHOUT_SENSE:
                await client.say(type="setup", **choice)
                assert "setup" in (await client.receive("error"))[0]["text"], choice
                assert server._setting_up._body.choices == before, choice

    asyncio.run(session())


def test_tetrahedra_and_numbers_of_a_saved_scene_are_exact(tmp_path):
    """The key of a store depends on every bit."""
    rng = np.random.default_rng(3)
    nodes = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) * 0.1 + rng.normal(0, 1e-3, (4, 3))
    mesh = TetMesh(nodes, np.array([[0, 1, 2, 3]])).to_quadratic()
    mesh.write(tmp_path / "mesh.vtu")
    assert np.array_equal(TetMesh.read(tmp_path / "mesh.vtu", "m").nodes, mesh.nodes)
    numbers = rng.normal(0, 1, 3).tolist()
    body = {"mesh": 'it\'s "new".vtu', "unit": "m"}
    region = {"shape": "sphere", "center": numbers, "radius": 0.1, "youngs_modulus": 1e4}
    (tmp_path / "a.toml").write_text(scene_text({"body": body, "supports": {"fixed": "z < 1mm"}, "region": [region]}))
    scene = palpate.Scene.read(tmp_path / "a.toml")
    assert list(scene.region[0].center) == numbers and scene.bodies[0].mesh == body["mesh"]


@pytest.mark.slow
def test_a_body_that_takes_long_is_touched_before_all_of_it_is_computed(ball, saves, monkeypatch):
    monkeypatch.setattr("palpate.scene.sizes.LONG", 0.0)

    async def session():
        async with empty_page(saves) as (server, client):
            await filled(client, ball)
            await client.say(type="setup", unit="mm")
            await client.say(type="touch")
            # The ball around the top that comes first has its first columns as the loop begins.
            await scene_where(client, lambda scene: len(scene["tools"]) == 1)
            surface = len(server._setting_up._body.mesh.surface_nodes)
            while [body["done"] for body in client.computed["bodies"]] != [3 * surface]:
                await client.receive("frame")
            assert client.computed["bodies"][0]["columns"] == 3 * surface
            assert server.session.built.scene.touch.first is not None
            await client.say(type="save")
            await setup_where(client, lambda m: m["body"]["saved"])

    asyncio.run(session())
    assert palpate.Scene.read(saves / "ball.toml").touch.first is None
