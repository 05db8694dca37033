"""A body set up in a real Chromium by the pointer alone: file dropped, support painted, touched, saved, run again."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest
import trimesh
from browser import MARKS, PATIENCE, Program, opened, press, settled_force, state, until
from label_maps import ball, ellipsoid, labels_of, write_nifti

import palpate

pytestmark = MARKS

# Sides of a block, mm.
SIDES = (60.0, 40.0, 30.0)
DROP = """([name, content]) => {
  const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
  const data = new DataTransfer();
  data.items.add(new File([bytes], name));
  for (const type of ["dragenter", "dragover", "drop"]) {
    window.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true, cancelable: true }));
  }
}"""


def drop(page, path: Path) -> None:
    page.evaluate(DROP, [path.name, base64.b64encode(path.read_bytes()).decode()])


def set_up(s: dict) -> bool:
    return s["connected"] and s["scene"] == "set up block" and s["filled"]


@pytest.fixture
def block(tmp_path) -> Path:
    shape = trimesh.creation.box(SIDES)
    for _ in range(3):
        shape = shape.subdivide()
    path = tmp_path / "block.stl"
    shape.export(path)
    return path


@pytest.fixture
def empty(cache, tmp_path):
    program = Program(cache, "--recordings", str(tmp_path / "saved"), command="run")
    yield program
    assert program.stop() == 0


def paint_front(page) -> None:
    """Brush along the front of the block, which is seen, in three lines."""
    depth = -5e-4 * SIDES[1]
    for height in (-0.010, -0.006, -0.002):
        ends = [page.evaluate("p => window.palpate.project(p)", [x, depth, height]) for x in (-0.024, 0.024)]
        page.mouse.move(*ends[0])
        page.mouse.down()
        page.mouse.move(*ends[1], steps=12)
        page.mouse.up()


def pressed(page) -> tuple[np.ndarray, float]:
    """Force of a press at the middle of the top, and its depth, once the series beyond small strain is there."""
    page.get_by_test_id("series-note").wait_for(state="hidden")
    press(page, 3, place=page.evaluate("p => window.palpate.project(p)", [0.0, 0.008, 5e-4 * SIDES[2]]))
    force = settled_force(page)
    depth = state(page)["depth"]
    page.mouse.up()
    return force, depth


@pytest.mark.slow
def test_a_dropped_file_is_set_up_touched_saved_and_run_again_with_the_same_force(
    chromium, empty, block, cache, tmp_path
):
    saved = tmp_path / "saved" / "block.toml"
    with opened(chromium, empty, ready=lambda s: s["connected"] and s["scene"] == "set up empty") as page:
        page.get_by_test_id("empty").wait_for()
        drop(page, block)
        until(page, set_up)
        # 60 of what: millimetres, or more.
        page.get_by_test_id("setup-question").wait_for()
        page.get_by_test_id("unit-mm").click()
        assert page.get_by_test_id("setup-size").inner_text() == "60 × 40 × 30 mm"
        page.get_by_test_id("setup-tissue").select_option("gelatine")
        page.get_by_test_id("setup-paint").click()
        paint_front(page)
        page.get_by_test_id("setup-touch").click()
        until(page, lambda s: s["scene"] == "block" and s["frames"] > 3)
        force, depth = pressed(page)
        page.get_by_test_id("touched-save").click()
        page.get_by_test_id("touched-saved").wait_for()
        assert page.get_by_test_id("touched-saved-path").inner_text() == str(saved)
        # Back to the set-up: what is painted is still there, and a wrong file changes nothing.
        page.get_by_test_id("touched-edit").click()
        until(page, set_up)
        wrong = tmp_path / "wrong.stl"
        wrong.write_text("nothing")
        drop(page, wrong)
        page.get_by_text("cannot be read as a surface").wait_for()
        page.get_by_test_id("status").wait_for(state="hidden")
        assert state(page)["held"] > 20 and set_up(state(page))
    scene = palpate.Scene.read(saved)
    assert scene.supports.fixed == "block.nodes"
    held = np.array(saved.with_suffix(".nodes").read_text().partition("\n")[2].split(), dtype=int)
    places = palpate.TetMesh.read(saved.with_suffix(".vtu"), "m").nodes[held]
    # What is held is what was painted: the front, below the top.
    assert len(held) > 20 and np.allclose(places[:, 1], -5e-4 * SIDES[1], atol=1e-6)
    stores = sorted((cache / "palpate").rglob("*.palpate"))
    program = Program(cache, str(saved), command="run")
    try:
        with opened(chromium, program) as page:
            again, depth_again = pressed(page)
    finally:
        assert program.stop() == 0
    # No store was computed for it, and what is felt is the same: the tool comes to rest within 1e-6 of its way.
    assert sorted((cache / "palpate").rglob("*.palpate")) == stores
    assert depth_again == pytest.approx(depth, rel=1e-9)
    assert again[2] == pytest.approx(force[2], rel=1e-3) and force[2] > 0.02


@pytest.mark.slow
def test_filling_is_cancelled_and_a_nodule_is_dragged(chromium, empty, block):
    with opened(chromium, empty, ready=lambda s: s["connected"] and s["scene"] == "set up empty") as page:
        drop(page, block)
        page.get_by_test_id("status-cancel").click(timeout=1e3 * PATIENCE)
        page.get_by_text("cancelled").wait_for()
        page.get_by_test_id("empty").wait_for()
        drop(page, block)
        until(page, set_up)
        page.get_by_test_id("unit-mm").click()
        page.get_by_test_id("setup-nodule").click()
        before = np.array(until(page, lambda s: s["nodule"] is not None)["nodule"])
        x, y = page.evaluate("p => window.palpate.project(p)", before.tolist())
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 60, y, steps=6)
        page.mouse.up()
        after = np.array(state(page)["nodule"])
        shown = page.evaluate("p => window.palpate.project(p)", after.tolist())
        # Its middle follows the pointer to a pixel, within the plane that faces the viewer.
        assert shown == pytest.approx([x + 60, y], abs=1.0)
        towards = np.array(page.evaluate("window.palpate.view()")["towards"])
        assert abs((after - before) @ towards) < 1e-6 and np.linalg.norm(after - before) > 2e-3


@pytest.mark.slow
def test_a_dropped_label_map_is_touched_with_a_material_for_each_segment(chromium, empty, tmp_path):
    pytest.importorskip("pytetwild", reason="pytetwild has no wheel for macOS", exc_type=ImportError)
    labels, affine = labels_of([ellipsoid((40, 30, 22)), ball((8, -4, 0), 14.0)], (46, 36, 28), (1.5, 1.5, 2.0))
    path = write_nifti(tmp_path / "ct.nii.gz", labels, affine)
    with opened(chromium, empty, ready=lambda s: s["connected"] and s["scene"] == "set up empty") as page:
        drop(page, path)
        until(page, lambda s: s["connected"] and s["scene"] == "set up ct" and s["filled"])
        assert page.get_by_test_id("setup-question").is_hidden()
        page.get_by_test_id("segment-2").select_option("silicone")
        page.get_by_test_id("setup-touch").click()
        until(page, lambda s: s["scene"] == "ct" and s["frames"] > 3, 3 * PATIENCE)
        press(page, 3, place=page.evaluate("p => window.palpate.project(p)", [0.0, 0.0, 0.022]))
        assert np.linalg.norm(settled_force(page)) > 0.02
        page.mouse.up()
        page.get_by_test_id("touched-save").click()
        page.get_by_test_id("touched-saved").wait_for()
    (region,) = palpate.Scene.read(tmp_path / "saved" / "ct.toml").region
    assert region.youngs_modulus == 69e3
