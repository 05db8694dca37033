"""Label maps that are dropped on the page: their segments, a material for each, and the scene that is saved."""

from __future__ import annotations

import asyncio
import contextlib

import numpy as np
import pytest
from label_maps import ball, ellipsoid, labels_of, write_nifti, write_nrrd
from viewer_client import page, serving

import palpate
from palpate.body.tissues import TISSUES
from palpate.segmentation import load_label_map
from palpate.segmentation.boundaries import default_segments, selectors
from palpate.viewer.setting_up import ENDINGS, Upload

SEMI, AT, RADIUS = (40.0, 30.0, 22.0), (12.0, -6.0, 8.0), 7.0
COARSE = (1.5, 1.5, 2.0)


def liver_with_a_tumour() -> tuple[np.ndarray, np.ndarray]:
    return labels_of([ellipsoid(SEMI), ball(AT, RADIUS)], (46, 36, 28), COARSE)


async def filled(client, path) -> tuple[dict | None, dict]:
    """Drop a file. Returns what is known of the body before it is filled, and then."""
    content = path.read_bytes()
    await client.say(type="upload", name=path.name, size=len(content))
    for start in range(0, len(content), 100_000):
        await client.receive("uploaded")
        await client.socket.send(content[start : start + 100_000])
    early = None
    while True:
        body = (await client.receive("setup"))[0]["body"]
        if body and not body["filled"]:
            early = body
        if body and body["filled"]:
            return early, body


@contextlib.asynccontextmanager
async def empty_page(saves):
    async with serving(None, recordings=saves) as server, page(server) as client:
        await client.receive("scene")
        yield server, client


@pytest.mark.slow
def test_segments_of_a_dropped_file_have_materials_of_their_own_in_the_saved_scene(tmp_path):
    pytest.importorskip("pytetwild", reason="pytetwild has no wheel for macOS", exc_type=ImportError)
    labels, affine = liver_with_a_tumour()
    path = write_nrrd(tmp_path / "ct.seg.nrrd", labels, affine, {"liver": 1, "fatty lump": 2})
    saves = tmp_path / "saves"
    saves.mkdir()

    async def session():
        async with empty_page(saves) as (server, client):
            early, body = await filled(client, path)
            # Its boundary was drawn before it was filled.
            assert early["name"] == "ct" and np.allclose(early["size"], 2e-3 * np.array(SEMI), atol=2e-3)
            assert body["name"] == "ct" and body["unit"] == "mm"
            # A segment that is called by a material of the list has it.
            assert body["segments"] == [{"name": "fatty lump", "tissue": "fat"}]
            await client.say(type="setup", segments=[{"name": "fatty lump", "tissue": "silicone"}], tissue="liver")
            await client.say(type="setup", segments=[{"name": "other", "tissue": "silicone"}])
            assert "segments" in (await client.receive("error"))[0]["text"]
            await client.say(type="save")
            while not (message := (await client.receive("setup"))[0])["body"]["saved"]:
                pass
            assert message["body"]["segments"] == [{"name": "fatty lump", "tissue": "silicone"}]
            return server._setting_up._body.mesh

    mesh = asyncio.run(session())
    scene = palpate.Scene.read(saves / "ct.toml")
    silicone = next(tissue for tissue in TISSUES if tissue.name == "silicone")
    (region,) = scene.region
    assert region.youngs_modulus == silicone.youngs_modulus
    body = palpate.scene.build.unsolved_body(scene)
    stiff = body.element_materials[:, 0] == silicone.youngs_modulus
    assert np.array_equal(stiff, mesh.regions == mesh.region_names["fatty lump"])
    assert mesh.volumes[stiff].sum() == pytest.approx((labels == 2).sum() * 1e-9 * np.prod(COARSE), rel=0.05)


def test_the_segments_of_a_body_hang_together_with_the_largest(tmp_path):
    away = ball((-38.0, 28.0, 20.0), 5.0)
    speck = ball((38.0, 28.0, 20.0), 1.2)
    labels, affine = labels_of([ellipsoid((30, 22, 16)), ball((5, 5, 5), 6.0), away, speck], (46, 36, 28), COARSE)
    read = load_label_map(write_nifti(tmp_path / "ct.nii.gz", labels, affine))
    chosen, left_out = default_segments(read)
    assert selectors(read, chosen) == ["1", "2"] and left_out == ["3", "4"]


def test_a_name_with_two_endings_is_taken_and_a_zipped_surface_is_not(tmp_path):
    assert {".nrrd", ".nii", ".nii.gz"} <= set(ENDINGS)
    Upload({"type": "upload", "name": "CT.NII.GZ", "size": 10}, tmp_path).close()
    with pytest.raises(palpate.ViewerError, match="no surface, mesh or segmentation"):
        Upload({"type": "upload", "name": "ct.stl.gz", "size": 10}, tmp_path)


def test_a_damaged_label_map_is_one_line(tmp_path):
    path = tmp_path / "ct.nii.gz"
    path.write_bytes(b"\x1f\x8b" + bytes(200))

    async def session():
        async with empty_page(tmp_path) as (server, client):
            content = path.read_bytes()
            await client.say(type="upload", name=path.name, size=len(content))
            await client.receive("uploaded")
            await client.socket.send(content)
            text = (await client.receive("error"))[0]["text"]
            assert text.startswith("ct.nii.gz: ") and "\n" not in text and str(tmp_path) not in text
            while server.is_building:
                await asyncio.sleep(0.01)

    asyncio.run(session())
