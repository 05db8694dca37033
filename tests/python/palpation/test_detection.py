"""Hidden nodules are found where they are; what is softer is told as such; bodies that do not compare are refused."""

from __future__ import annotations

import csv

import numpy as np
import pytest
import trimesh
from palpated import HEIGHT, SIDE, TOP, block_body, scene_of

import palpate
from palpate.palpation import compare, stiffness_map
from palpate.validation.verify import palpation as benchmark
from palpate.validation.verify.grids import box


@pytest.mark.slow
@pytest.mark.parametrize(("place", "below", "radius"), [((0.018, 0.023), 0.008, 0.005), ((0.026, 0.019), 0.011, 0.006)])
def test_a_nodule_is_found_at_its_place(tmp_path, place, below, radius):
    scene = benchmark.slab(tmp_path, place, below, radius, size=0.02)
    found = stiffness_map(scene, "8mm", "1.5mm", on=TOP)
    detection = compare(found)
    foremost = detection.nodules[0]
    off = np.linalg.norm(foremost.place[:2] - place)
    print(f"{foremost}, {1e3 * off:.2g} mm off")
    assert off < 2e-3 and foremost.ratio > 1.04
    assert 0.002 < foremost.half_width < 0.012
    # A body in which nothing has become softer is nowhere softer.
    assert detection.ratio.min() > 1 - 5e-3
    detection.save(tmp_path / "found")
    with (tmp_path / "found" / "nodules.csv").open(newline="") as stream:
        (row, *_) = csv.DictReader(stream)
    assert float(row["x_m"]) == pytest.approx(foremost.place[0], rel=1e-8)
    values = detection.to_meshio().point_data["ratio"]
    assert np.nanmax(values) > 1.04


@pytest.fixture(scope="module")
def top(block):
    return stiffness_map(block, "15mm", "0.3mm", on=TOP)


def test_a_body_of_one_material_hides_nothing(top):
    with pytest.raises(palpate.SceneError, match="of one material each: give a scene to compare with"):
        compare(top)


def test_another_scene_of_the_same_shape_is_compared_with(top, store):
    softer = palpate.precompute(block_body(8e3), precision="f64", path=store.with_name("softer.palpate"))
    detection = compare(top, scene_of(softer.path))
    # Forces of one material go with its modulus.
    assert np.allclose(detection.ratio, 10 / 8, rtol=1e-6)
    assert np.allclose(detection.difference, top.stiffness * (1 - 8 / 10), rtol=1e-6)


def test_a_body_of_another_shape_is_refused(top, store):
    mesh = box((3, 3, 2), (SIDE, SIDE, 0.9 * HEIGHT), quadratic=True)
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=lambda p: p[:, 2] < 1e-9)
    lower = palpate.precompute(body, path=store.with_name("lower.palpate"))
    with pytest.raises(palpate.SceneError, match="has another shape: its surface lies up to 4 mm off"):
        compare(top, scene_of(lower.path))


def test_the_tool_of_a_map_is_that_of_its_own_folder(store, tmp_path):
    stiffer = tmp_path / "stiffer.palpate"
    palpate.precompute(block_body(12e3), precision="f64", path=stiffer)
    for name, radius, file in (("ours", 0.005, store), ("theirs", 0.002, stiffer)):
        (tmp_path / name).mkdir()
        trimesh.creation.icosphere(2, radius).export(tmp_path / name / "tip.stl")
        text = f'[body]\nstore = "{file}"\n[tool]\nshape = "tip.stl"\nunit = "m"\n[view]\nstrain_limit = 0\n'
        (tmp_path / name / "scene.toml").write_text(text)
    ours, theirs = (palpate.Scene.read(tmp_path / name / "scene.toml") for name in ("ours", "theirs"))
    found = stiffness_map(ours, "30mm", "0.3mm", on=TOP)
    assert compare(found, theirs).ratio == pytest.approx(10 / 12, rel=1e-3)
