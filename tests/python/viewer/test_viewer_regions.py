"""Regions and ranges of colours, as the page is told of them."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from conftest import box_mesh
from viewer_client import frame_of, page, serving

import palpate
from palpate.mesh import TetMesh
from palpate.scene import BuiltScene
from palpate.viewer import messages
from palpate.viewer.fields import ClientView
from palpate.viewer.session import Session

TOP = [0.04, 0.025, 0.05]


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuiltScene:
    """A block of two regions of its file, and a ball in it that a scene has made stiffer."""
    folder, mesh = tmp_path_factory.mktemp("regions"), box_mesh(cells=(8, 5, 5))
    upper = mesh.nodes[mesh.tets].mean(axis=1)[:, 2] > 0.03
    TetMesh(mesh.nodes, mesh.tets, np.where(upper, 7, 2)).write(folder / "block.vtu")
    return palpate.Scene(
        body={"mesh": str(folder / "block.vtu")},
        supports={"fixed": "x < 1mm"},
        region=[{"shape": "sphere", "center": [0.04, 0.025, 0.025], "radius": 0.012, "youngs_modulus": 80e3}],
    ).build()


def test_every_tetrahedron_is_told_its_region_and_that_its_material(built):
    header, arrays = messages.decode(Session(built).scene_message())
    regions = header["bodies"][0]["regions"]
    assert [region["title"] for region in regions] == ["Region 2", "Sphere", "Region 7"]
    assert [region["youngs_modulus"] for region in regions] == [10e3, 80e3, 10e3]
    centres = arrays["0/nodes"][arrays["0/tets"]].mean(axis=1)
    in_ball = np.linalg.norm(centres - [0.04, 0.025, 0.025], axis=1) < 0.012
    expected = np.where(in_ball, 1, np.where(centres[:, 2] > 0.03, 2, 0))
    assert np.array_equal(arrays["0/tet_regions"], expected)
    assert set(expected) == {0, 1, 2}


def test_a_region_of_the_file_that_a_table_claims_has_one_name(tmp_path):
    mesh = box_mesh()
    ends = mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.06
    names = {"soft": 1, "capsule": 2}
    TetMesh(mesh.nodes, mesh.tets, np.where(ends, 2, 1), names).write(tmp_path / "block.msh")
    built = palpate.Scene(
        body={"mesh": str(tmp_path / "block.msh")},
        supports={"fixed": "x < 1mm"},
        region=[{"mesh_region": "capsule", "youngs_modulus": 80e3}],
    ).build()
    header, arrays = messages.decode(Session(built).scene_message())
    assert [region["title"] for region in header["bodies"][0]["regions"]] == ["Soft", "Capsule"]
    assert np.array_equal(arrays["0/tet_regions"], ends)


def test_parts_of_a_quadratic_element_are_in_its_region(block, block_green):
    ends = block.mesh.nodes[block.mesh.tets].mean(axis=1)[:, 0] > 0.06
    mesh = TetMesh(block.mesh.nodes, block.mesh.tets, ends.astype(int)).to_quadratic()
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
    scene = palpate.Scene.of_store("block.palpate")
    session = Session(BuiltScene.of(scene, body, palpate.precompute(body)))
    _, arrays = messages.decode(session.scene_message())
    assert np.array_equal(arrays["0/tet_regions"], np.repeat(ends, 8))
    assert len(arrays["0/tets"]) == 8 * len(mesh.tets)


def test_colours_follow_the_largest_value_or_end_where_a_page_wants(built):
    async def session():
        async with serving(built) as server, page(server) as client:
            scene, _ = await client.receive("scene")
            radius = scene["tools"][0]["radius"]
            await client.say(type="press", tool=0, position=[TOP[0], TOP[1], TOP[2] + radius - 2e-3], grab=False)
            await client.frame_where(lambda h: h["time"] > 0.6 and h["fields"][0]["largest"] > 0.5)

            def shares(header, arrays):
                field, moved = header["fields"][0], arrays["0/displacements"].astype(float)
                assert field["largest"] == pytest.approx(1e3 * np.linalg.norm(moved, axis=1).max(), rel=1e-6)
                expected = np.clip(255e3 * np.linalg.norm(moved, axis=1) / field["max"], 0, 255)
                assert np.allclose(arrays["0/scalar"], expected, atol=0.51)
                return field["max"] / field["largest"]

            assert shares(*await client.receive("frame")) >= 1
            for end in (10.0, 0.25):
                await client.say(type="field", name="displacement", max=end)
                header, arrays = await client.frame_where(lambda h, end=end: h["fields"][0]["max"] == end)
                assert (shares(header, arrays) > 1) is (end > 1)
            await client.say(type="field", name="displacement")
            header, arrays = await client.frame_where(lambda h: h["fields"][0]["max"] != 0.25)
            assert shares(header, arrays) >= 1

    asyncio.run(session())


def test_an_end_in_one_unit_is_not_taken_for_another_field(built):
    session = Session(built)
    session.start()
    try:
        header, _ = frame_of(session, ClientView(field="unheard-of", full_scale=3.0))
    finally:
        session.close()
    field = header["fields"][0]
    assert field["name"] == "displacement" and field["max"] != 3.0
