"""Pages without a server: the same bits in WebAssembly as here, and the page in Chromium from a plain file server."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from browser import state, until
from web_site import drag, native_forces, page_of, served, waited, web_forces

import palpate
from palpate import simulation
from palpate.scene import model_scene
from palpate.viewer.site import find_program, with_precision, write_site
from palpate.viewer.tool_shapes import with_shape

# The site of the liver and three more takes a minute; the widget's tests run a small one.
pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]
# Program and scene of the liver may have so many bytes.
LARGEST_PROGRAM, LARGEST_SCENE = 3_000_000, 20_000_000


RUN = "async (p) => Array.from(await window.palpate.run(Float64Array.from(p)))"
# Moves the tool along a path and back for some seconds; counts of the page before and after, how late ticks were, us.
DRAG = """async ([path, seconds]) => {
  const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  // Of several frames that have just come the one that came soonest after its last tick: others have waited to be read.
  const counts = async () => {
    let soonest = null;
    for (let k = 0; k < 20; k++) {
      const shown = window.palpate.frame().frame;
      while (window.palpate.frame().frame === shown) await pause(1);
      const { ticks, missed_deadlines: missed } = window.palpate.frame();
      const now = performance.now();
      if (soonest === null || ticks + missed - now > soonest.ticks + soonest.missed - soonest.now) {
        soonest = { ticks, missed, now };
      }
    }
    return soonest;
  };
  const before = await counts();
  for (let k = 0; performance.now() - before.now < 1e3 * seconds; k++) {
    const at = k % (2 * path.length);
    window.palpate.move(path[at < path.length ? at : 2 * path.length - 1 - at]);
    await pause(8);
  }
  const { wakeup_us } = window.palpate.frame();
  return [before, await counts(), wakeup_us.p99, wakeup_us.max];
}"""


def scenes(folder: Path) -> dict[str, palpate.Scene]:
    """The block of the examples, pressed by a sphere and by a surface of a file, the liver, and a beam that swings."""
    block = palpate.Scene.read(ROOT / "examples" / "block.toml")
    trimesh.creation.icosphere(2, 5.0).apply_scale([1.0, 1.4, 0.8]).export(folder / "tool.stl")
    tool = {"shape": str(folder / "tool.stl"), "unit": "mm", "contact": "local"}
    return {
        "block": block,
        "surface": block.model_copy(update={"tools": palpate.Scene(body={"model": "beam"}, tool=tool).tools}),
        # In the cheapest numbers, of which a page fetches half as many bytes.
        "liver": with_precision(model_scene("liver"), "f16"),
        "beam": model_scene("beam", paper=True, motion=True),
    }


@pytest.fixture(scope="module")
def site(cache, tmp_path_factory):
    """A site of three scenes, their simulations, and the sizes that were written."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        files = tmp_path_factory.mktemp("files")
        built = {name: scene.build(progress=False) for name, scene in scenes(files).items()}
        folder = tmp_path_factory.mktemp("web") / "sub" / "site"
        folder.parent.mkdir()
        sizes = write_site(list(built.items()), folder)
    return folder, built, sizes


@pytest.mark.parametrize("name", ["block", "surface", "liver", "beam"])
def test_forces_in_webassembly_are_the_native_ones_to_the_bit(site, tmp_path, name):
    folder, built, _ = site
    positions = drag(built[name])
    here = native_forces(built[name], positions)
    there, _ = web_forces(folder, name, positions, tmp_path)
    assert np.linalg.norm(here, axis=1).max() > 0.01, "a press that is felt"
    assert here.tobytes() == there.tobytes()


@pytest.mark.parametrize("shape", ["ellipsoid", "capsule", "punch"])
def test_forces_of_another_tool_are_the_native_ones_to_the_bit(site, tmp_path, shape):
    folder, built, _ = site
    block = built["block"]
    tools = [with_shape(block.scene.tools[0], shape, block.scene.folder)]
    changed = replace(block, scene=block.scene.model_copy(update={"tools": tools}))
    positions = drag(changed)
    here = native_forces(changed, positions)
    there, _ = web_forces(folder, "block", positions, tmp_path, shape)
    assert np.linalg.norm(here, axis=1).max() > 0.01, "a press that is felt"
    assert here.tobytes() == there.tobytes()


def test_an_unknown_precision_is_refused():
    with pytest.raises(palpate.SceneError, match=r"^unknown precision 'f7': use f16, f32, f64$"):
        with_precision(model_scene("liver"), "f7")


def test_program_and_liver_are_small(site):
    _, _, sizes = site
    assert sizes.program <= LARGEST_PROGRAM
    assert sizes.scenes["liver"] <= LARGEST_SCENE


def test_a_folder_of_something_else_is_not_replaced(site, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(palpate.Error, match="folder of something else"):
        write_site([("block", site[1]["block"])], tmp_path)
    assert find_program().is_file()


def test_a_gallery_has_one_program_and_no_dead_links(site, tmp_path):
    folder, _, sizes = site
    script = ROOT / "scripts" / "check_site.py"
    checked = subprocess.run([sys.executable, script, folder], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr
    assert sizes.total == sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    broken = tmp_path / "site"
    shutil.copytree(folder, broken)
    (broken / "scenes" / "liver.palpate").unlink()
    shutil.copyfile(broken / "palpate.wasm", broken / "scenes" / "again.wasm")
    checked = subprocess.run([sys.executable, script, broken], capture_output=True, text=True)
    assert checked.returncode == 1
    assert "scene liver, which is missing" in checked.stderr and "2 programs" in checked.stderr


def test_a_picture_shows_a_body_on_any_ground(site):
    from PIL import Image

    folder, _, _ = site
    with Image.open(folder / "pictures" / "liver.webp") as picture:
        pixels = np.asarray(picture.convert("RGBA"))
    opaque = pixels[..., 3] > 0
    assert not opaque[[0, -1]].any() and not opaque[:, [0, -1]].any(), "nothing is cut off"
    assert 0.15 < opaque.mean() < 0.8
    assert len(np.unique(pixels[opaque][:, :3], axis=0)) > 500, "light and colours"


def test_scenes_of_one_name_are_refused(site, tmp_path):
    block = site[1]["block"]
    with pytest.raises(palpate.Error, match="two scenes are called 'a'"):
        write_site([("a", block), ("a", block)], tmp_path / "site")


@pytest.mark.browser
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium")
class TestPage:
    """From a folder below the root of a file server."""

    @pytest.mark.slow
    def test_runs_drags_and_records(self, chromium, site, tmp_path):
        folder, built, _ = site
        with served(folder.parents[1]) as address, page_of(chromium, f"{address}/sub/site/touch.html") as page:
            positions = drag(built["block"])
            forces = page.evaluate(
                "async (p) => Array.from(await window.palpate.run(Float64Array.from(p)))", positions.ravel().tolist()
            )
            assert np.array(forces).tobytes() == native_forces(built["block"], positions).tobytes()
            page.evaluate("() => document.getElementById('record').click()")
            waited(lambda: page.evaluate("() => window.palpate.frame().recording !== null"))
            for place in positions[::40].tolist():
                page.evaluate("(p) => window.palpate.move(p)", place)
                page.wait_for_timeout(30)
            waited(lambda: page.evaluate("() => Math.hypot(...window.palpate.frame().tools[0].force)") > 0.05)
            assert page.evaluate("() => window.palpate.frame().contacts[0].error") > 0, "a law beyond small strain"
            with page.expect_download() as download:
                page.evaluate("() => document.getElementById('record').click()")
            path = tmp_path / "page.mcap"
            download.value.save_as(path)
        again = simulation.replay(path, built["block"])
        assert again.ticks > 100
        assert again.same, again.differences[:3]

    @pytest.mark.parametrize("name", ["liver", "beam"])
    def test_forces_in_chromium_are_the_native_ones_to_the_bit(self, chromium, site, name, capsys):
        folder, built, _ = site
        with (
            served(folder.parents[1]) as address,
            page_of(chromium, f"{address}/sub/site/touch.html?scene={name}") as page,
        ):
            ready = page.evaluate("async () => { await window.palpate.ready; return performance.now(); }")
            positions = drag(built[name])
            forces = page.evaluate(RUN, positions.ravel().tolist())
        assert np.array(forces).tobytes() == native_forces(built[name], positions).tobytes()
        with capsys.disabled():
            print(f"\n  {name}: ready for the first touch within {1e-3 * ready:.2f} s of the page's load")

    def test_a_link_of_the_gallery_opens_a_body_with_tools_and_models(self, chromium, site, tmp_path):
        """Another tool, recorded and replayed to the bit; another body, whose address opens it again."""
        folder, _, _ = site
        with served(folder.parents[1]) as address, page_of(chromium, f"{address}/sub/site/", "null") as page:
            assert page.locator("a").count() == page.locator("img").count() == 4
            page.locator("a", has_text="Block").click()
            page.wait_for_url("**/touch.html?scene=block")
            page.evaluate("() => window.palpate.ready")
            page.locator("#shape").select_option("capsule")
            until(page, lambda s: s["shape"] == "capsule")
            page.evaluate("() => document.getElementById('record').click()")
            waited(lambda: page.evaluate("() => window.palpate.frame().recording !== null"))
            for height in (70, 60, 52, 50):
                page.evaluate("(z) => window.palpate.move([0.04, 0.025, 1e-3 * z])", height)
                page.wait_for_timeout(60)
            until(page, lambda s: s["forceMagnitude"] > 0.01)
            with page.expect_download() as download:
                page.evaluate("() => document.getElementById('record').click()")
            download.value.save_as(tmp_path / "page.mcap")
            page.locator("#model").select_option("beam")
            until(page, lambda s: s["scene"] == "beam")
            assert page.url.endswith("touch.html?scene=beam")
            page.reload()
            page.evaluate("() => window.palpate.ready")
            assert state(page)["scene"] == "beam"
        recording = palpate.Recording.load(tmp_path / "page.mcap")
        assert json.loads(recording.about["scene"])["tool"][0]["shape"] == "capsule"
        again = simulation.replay(tmp_path / "page.mcap")
        assert again.ticks > 100
        assert again.same, again.differences[:3]

    def test_works_without_a_network_after_the_first_load(self, chromium, site):
        folder, _, _ = site
        with served(folder.parents[1]) as address, page_of(chromium, f"{address}/sub/site/touch.html") as page:
            kept = "async () => (await caches.keys()).length && (await (await caches.open('palpate')).keys()).length"
            waited(lambda: page.evaluate(kept) >= 5)
            page.context.set_offline(True)
            page.reload()
            page.evaluate("() => window.palpate.ready")
            assert page.evaluate("() => window.palpate.state().scene") == "block"

    @pytest.mark.slow
    def test_no_tick_is_lost_over_half_a_minute_of_dragging(self, chromium, site, capsys):
        """Ticks made and ticks shown as missed are all that were due; how late they came is printed."""
        folder, built, _ = site
        with served(folder.parents[1]) as address, page_of(chromium, f"{address}/sub/site/touch.html") as page:
            before, after, p99, late = page.evaluate(DRAG, [drag(built["block"])[200:].tolist(), 30.0])
        ticks, missed, ms = (after[key] - before[key] for key in ("ticks", "missed", "now"))
        with capsys.disabled():
            print(
                f"\n  {1e3 * ticks / ms:.0f} ticks a second, {missed} missed; late: p99 {p99:.0f}, worst {late:.0f} us"
            )
        # A frame comes some time after its last tick, on a machine that draws in software.
        assert abs(ticks + missed - ms) < 500
        assert ticks > 0
