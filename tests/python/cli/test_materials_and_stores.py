"""Materials with constants, and stores beside a user's own files, on the command line."""

from __future__ import annotations

import pytest
from command_line import refused, run
from conftest import box_mesh

import palpate

SCENE = """[body]
mesh = "box.vtu"
unit = "m"
[supports]
fixed = "z < min + 1mm"
[material]
"""
RUBBER = 'law = "mooney-rivlin"\nc10 = "1kPa"\nc01 = "2kPa"\n'
REGION = '[[region]]\nshape = "box"\nlow = [-1, -1, -1]\nhigh = [1, 1, 1]\n'


@pytest.fixture
def box(tmp_path):
    mesh = box_mesh((3, 3, 3))
    palpate.TetMesh(mesh.nodes, mesh.tets).write(tmp_path / "box.vtu")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("box.vtu", "a store ends in .palpate: name it box.palpate"),
        ("notes.palpate", "exists, and is no store"),
    ],
)
def test_a_store_takes_the_place_of_no_other_file(box, name, words):
    (box / "notes.palpate").write_text("what I have written by hand, in some lines of text")
    before = (box / name).read_bytes()
    found = run("precompute", "box.vtu", "--unit", "m", "--fix", "z < min + 1mm", "-o", name, cwd=box)
    refused(found, name, words)
    assert (box / name).read_bytes() == before


def test_a_store_takes_the_place_of_a_store_damaged_or_not(box):
    again = ("precompute", "box.vtu", "--unit", "m", "--fix", "z < min + 1mm", "-o", "a.palpate")
    assert run(*again, cwd=box).returncode == 0
    whole = (box / "a.palpate").read_bytes()
    (box / "a.palpate").write_bytes(whole[: len(whole) // 2])
    assert run(*again, cwd=box).returncode == 0
    assert (box / "a.palpate").read_bytes() == whole


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("touch", "scene.toml", "--point", "0,0,0", "--press", "0,0,0"), "'palpate precompute scene.toml' makes one"),
        (("pack", "box.vtu", "out"), "box.vtu is no scene: write one (.toml)"),
        (("web", "box.vtu", "out"), "box.vtu is no scene: write one (.toml)"),
        (("web", "livr", "out"), "livr: no such file, and no model of that name; models are doll, kidney, liver, beam"),
        (("info", "a.step"), "a.step: files of this kind are not read: scenes are .toml, stores .palpate"),
        (("run", "a.step"), "a.step: files of this kind are not read"),
        (("precompute", "box.vtu", "--fix", "z<1", "-E", "10mm"), "-E: unknown unit 'mm'"),
        (("precompute", "box.vtu", "--fix", "z<1", "--unit", "MM"), "--unit: unknown length unit 'MM'"),
        (("info", "box.vtu", "--unit", "MM"), "--unit: unknown length unit 'MM'"),
        (("run", "box.vtu", "--headless", "1", "--unit", "MM"), "--unit: unknown length unit 'MM'"),
        (("run", "box.vtu", "--headless", "1", "-E", "10mm"), "-E: unknown unit 'mm'"),
        (("run", "scene.toml", "--headless", "1", "--radius", "5foo"), "--radius: unknown unit 'foo'"),
        (("mesh", "box.vtu", "out.vtu", "--max-size", "5foo"), "--max-size: unknown unit 'foo'"),
        (("mesh", "box.vtu", "out.vtu", "--segment", "liver=4foo"), "--segment liver=4foo: unknown unit 'foo'"),
    ],
)
def test_what_does_not_suit_a_command_is_named_in_one_line(box, words, message):
    (box / "scene.toml").write_text(SCENE)
    (box / "a.step").write_text("ISO-10303-21;")
    before = sorted(path.name for path in box.iterdir())
    found = run(*words, cwd=box)
    refused(found, message)
    assert found.stdout == "" and sorted(path.name for path in box.iterdir() if path.name != "cache") == before


@pytest.mark.parametrize("seconds", ["inf", "nan"])
def test_a_run_without_an_end_is_refused(box, seconds):
    found = run("run", "box.vtu", "--headless", seconds, cwd=box)
    assert found.returncode == 2 and "--headless" in found.stderr


def test_a_segment_that_is_not_stiff_is_refused(box):
    (box / "map.nrrd").write_text("")
    found = run("mesh", "map.nrrd", "map.vtu", "--segment", "1=-4kPa", cwd=box)
    refused(found, "--segment 1=-4kPa: a Young's modulus is positive")


def test_a_map_is_for_the_page(box):
    found = run("run", "box.vtu", "--headless", "1", "--map", "box.vtu", cwd=box)
    assert found.returncode == 2 and "--map is shown in the page" in found.stderr and "Traceback" not in found.stderr


@pytest.mark.parametrize(
    ("material", "region", "words"),
    [
        (RUBBER, 'c20 = "9kPa"', "'c20' does not belong to law 'mooney-rivlin'"),
        ('law = "yeoh"\nc10 = "1kPa"\n', 'law = "mooney-rivlin"', "needs c10"),
        ("", 'c10 = "1kPa"', "'c10' does not belong to law 'neo-hookean'"),
    ],
)
def test_a_wrong_material_of_a_region_is_one_line(box, material, region, words):
    (box / "scene.toml").write_text(f"{SCENE}{material}{REGION}{region}\n")
    line = (SCENE + material).count("\n") + 1
    for command in ("info", "precompute"):
        refused(run(command, "scene.toml", cwd=box), f"scene.toml:{line}: region", words)


def test_constants_of_a_region_follow_its_modulus(box):
    """E of a Mooney-Rivlin solid at small strain is 4 (1 + nu) (c10 + c01)."""
    (box / "scene.toml").write_text(f'{SCENE}{RUBBER}{REGION}youngs_modulus = "34.8kPa"\n')
    found = run("info", "scene.toml", cwd=box)
    assert "material.youngs_modulus = 17400.0" in found.stdout
    scene = palpate.Scene.read(box / "scene.toml")
    part = scene.region[0].material(scene.material)
    assert (part.c10, part.c01) == pytest.approx((2e3, 4e3)) and part.youngs_modulus == pytest.approx(34.8e3)


def test_a_modulus_that_constants_give_is_not_typed(box):
    (box / "scene.toml").write_text(SCENE + RUBBER)
    refused(run("run", "scene.toml", "-E", "3kPa", "--headless", "0.1", cwd=box), "-E: law 'mooney-rivlin'", "17400 Pa")
