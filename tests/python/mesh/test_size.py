"""A body of an unlikely size asks for its unit of length; sizes are told, and so is where a touch landed."""

from __future__ import annotations

import contextlib
import os
import pty
import subprocess
import sys
import threading

import numpy as np
import pytest
import trimesh
from command_line import refused
from command_line import run as command
from conftest import box_mesh

import palpate

MAIN = [sys.executable, "-c", "from palpate.cli import main; main()"]


@pytest.fixture
def millimetres(tmp_path):
    """A box of 80 x 50 x 50, as a modelling program writes it, and as a volume mesh."""
    box_mesh().write(tmp_path / "box.vtu", unit="mm")
    trimesh.creation.box(extents=(80, 50, 50)).export(tmp_path / "box.stl")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("file", ["box.vtu", "box.stl"])
def test_a_body_of_eighty_metres_asks_for_its_unit(millimetres, file):
    read = palpate.TetMesh.read if file.endswith("vtu") else palpate.tetrahedralize
    match = r"in metres the body is 80 x 50 x 50 m; which unit.*mm \(80 x 50 x 50 mm\) or cm \(800 x 500 x 500 mm\)"
    with pytest.raises(palpate.UnclearUnitError, match=match) as refusal:
        read(millimetres / file)
    assert refusal.value.fitting == ("mm", "cm", "in")
    assert read(millimetres / file, unit="mm").volume == pytest.approx(2e-4, rel=1e-9)


def test_a_unit_that_was_given_is_taken_at_its_word(millimetres):
    with pytest.warns(palpate.MeshWarning, match="the body is 80 x 50 x 50 m; is its unit of length really m"):
        mesh = palpate.TetMesh.read(millimetres / "box.vtu", unit="m")
    assert mesh.volume == pytest.approx(2e5, rel=1e-9)
    with pytest.warns(palpate.MeshWarning, match="the body is 80 x 50 x 50 um"):
        palpate.TetMesh.read(millimetres / "box.vtu", unit="um")


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ("5", r"elements of 5 m \(--max-size, max_element_size\) are larger than the body of 80 x 50 x 50 mm"),
        ("4m", r"elements of 4 m .* are larger than the body"),
        # 3.5 V/h^3 of V = 2e-4 m^3.
        ("0.01mm", r"elements of 0\.01 mm .* would be about 7e\+11, more than 5 million: give at least 0\.519 mm"),
    ],
)
@pytest.mark.parametrize("is_open", [False, True])
def test_elements_that_do_not_suit_a_body_are_refused(millimetres, size, message, is_open):
    box = trimesh.creation.box(extents=(0.08, 0.05, 0.05))
    if is_open:
        box.update_faces(np.arange(12) > 0)
        message = message.partition("about")[0]
    with pytest.raises(palpate.MeshError, match=message):
        palpate.tetrahedralize(box, size)
    typed = command("run", "box.stl", "--unit", "mm", "--max-size", size, "--headless", "1", cwd=millimetres)
    refused(typed, message.partition(" ")[0], "--max-size")


def test_commands_ask_in_one_line_and_print_the_size(millimetres):
    asked = command("mesh", "box.stl", "out.vtu", cwd=millimetres)
    assert asked.returncode == 2
    assert asked.stderr.count("\n") == 1 and "--unit mm" in asked.stderr
    assert not (millimetres / "out.vtu").exists()
    result = command("mesh", "box.stl", "out.vtu", "--unit", "mm", "--max-size", "2cm", cwd=millimetres)
    assert "80 x 50 x 50 mm" in result.stdout, result.stderr
    assert "80 x 50 x 50 mm" in command("info", "out.vtu", cwd=millimetres).stdout
    unlikely = command("info", "box.vtu", cwd=millimetres)
    assert "80 x 50 x 50 m" in unlikely.stdout and "really m?" in unlikely.stderr
    solve = ("precompute", "box.vtu", "--fix", "z < 1mm", "-o", "box.palpate")
    assert "--unit mm" in command(*solve, cwd=millimetres).stderr
    solved = command(*solve, "--unit", "mm", cwd=millimetres)
    assert "a body of 80 x 50 x 50 mm" in solved.stdout, solved.stderr
    assert "a body of 80 x 50 x 50 mm" in command("info", "box.palpate", cwd=millimetres).stdout


def read_all(terminal: int) -> None:
    with contextlib.suppress(OSError):
        while os.read(terminal, 4096):
            pass


@pytest.mark.slow
def test_on_a_terminal_the_unit_is_asked_for(millimetres):
    terminal, end = pty.openpty()
    os.write(terminal, b"mm\n")
    # On a slow machine progress fills what a terminal holds, and a program waits until it is read.
    threading.Thread(target=read_all, args=(terminal,), daemon=True).start()
    options = {"stdin": end, "stderr": end, "stdout": subprocess.PIPE, "text": True, "timeout": 280}
    arguments = ("mesh", "box.stl", "out.vtu", "--max-size", "2cm")
    result = subprocess.run([*MAIN, *arguments], cwd=millimetres, check=False, **options)
    assert result.returncode == 0
    assert "80 x 50 x 50 mm" in result.stdout
    assert palpate.TetMesh.read(millimetres / "out.vtu").volume == pytest.approx(2e-4, rel=1e-9)


def test_a_scene_asks_too(millimetres):
    scene = '[body]\nmesh = "box.vtu"\n\n[supports]\nfixed = "z < min + 1mm"\n'
    (millimetres / "scene.toml").write_text(scene)
    with pytest.raises(palpate.UnclearUnitError, match="unit = 'mm'"):
        palpate.Scene.read(millimetres / "scene.toml").build(progress=False)


def test_a_touch_tells_where_it_landed(block, block_green):
    """The block is 80 x 50 x 50 mm, from the origin on: the closest point of a box is the point clipped to it."""
    near = block_green.touch((0.05, 0.02, 0.051), (None, None, -1e-3), 0.01)
    assert near.point == pytest.approx([0.05, 0.02, 0.05], abs=1e-12)
    assert near.distance == pytest.approx(1e-3, rel=1e-9)
    for point, text in [((0.2, 0.1, 0.03), "130 mm"), ((50.0, 20.0, 50.0), "73.38 m")]:
        landed = np.clip(point, 0, [0.08, 0.05, 0.05])
        distance = np.linalg.norm(landed - point)
        with pytest.raises(palpate.BodyError, match=f"lies {text} from the surface of the body, which is 80 x"):
            block_green.touch(point, (-1e-3, None, None), 0.01)
        far = block_green.touch(point, (-1e-3, None, None), 0.01, on_surface=False)
        assert far.point == pytest.approx(landed, abs=1e-12)
        assert far.distance == pytest.approx(distance, rel=1e-9)
        assert np.array_equal(far.force, block_green.touch(landed, (-1e-3, None, None), 0.01).force)


def test_the_command_tells_where_a_touch_landed(block_green, tmp_path):
    block_green.save(tmp_path / "block.palpate")
    press = ("touch", "block.palpate", "--press=-,-,-1mm", "--radius", "1cm", "--point")
    on_it = command(*press, "5cm,2cm,5cm", cwd=tmp_path)
    assert "landed" not in on_it.stdout + on_it.stderr
    beside = command(*press, "5cm,2cm,54mm", cwd=tmp_path)
    assert "landed at [0.05 0.02 0.05] m, 4 mm off the point" in beside.stdout
    refused(command(*press, "50,20,50", cwd=tmp_path), "the touch point lies 73.38 m from the surface")
