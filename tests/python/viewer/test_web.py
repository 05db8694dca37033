"""Pages without a server: the same bits in WebAssembly as here, and the page in Chromium from a plain file server."""

from __future__ import annotations

import contextlib
import functools
import http.server
import json
import shutil
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from browser import PATIENCE

import palpate
from palpate import simulation
from palpate.scene import model_scene
from palpate.viewer.site import find_program, with_precision, write_site

ROOT = Path(__file__).resolve().parents[3]
HARNESS = ROOT / "tests" / "web_run.mjs"
# Program and scene of the liver may have so many bytes.
LARGEST_PROGRAM, LARGEST_SCENE = 3_000_000, 20_000_000


def scenes() -> dict[str, palpate.Scene]:
    """The block of the examples, the liver, and a beam that swings."""
    return {
        "block": palpate.Scene.read(ROOT / "examples" / "block.toml"),
        # In the cheapest numbers, of which a page fetches half as many bytes.
        "liver": with_precision(model_scene("liver"), "f16"),
        "beam": model_scene("beam", paper=True, motion=True),
    }


@pytest.fixture(scope="module")
def site(cache, tmp_path_factory):
    """A site of three scenes, their simulations, and the sizes that were written."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        built = {name: scene.build(progress=False) for name, scene in scenes().items()}
        folder = tmp_path_factory.mktemp("web") / "sub" / "site"
        folder.parent.mkdir()
        sizes = write_site(list(built.items()), folder)
    return folder, built, sizes


def drag(built) -> np.ndarray:
    """Down onto the highest free place, of a level top its middle, half a tool deep, and 15 mm along it: (600, 3) m."""
    body = built.bodies[0]
    green = body.green
    free = ~np.isin(green.surface_nodes, green.fixed_nodes)
    places = green.surface_positions[free]
    places = places[places[:, 2] > places[:, 2].max() - 1e-6]
    top = places[np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1))]
    radius = built.scene.tools[0].shape_arguments(built.scene.folder)[1][0]
    height = np.concatenate([np.linspace(1.5, 0.6, 200), np.full(400, 0.6)]) * radius
    along = np.concatenate([np.zeros(200), np.linspace(0.0, 0.015, 400)])
    return body.points_to_scene(top + np.column_stack([0.3 * along, along, height]))


def native_forces(built, positions: np.ndarray) -> np.ndarray:
    """Forces of the same ticks here, strain measured by the surface as in a page."""
    here = palpate.Simulation(built)
    here._by_surface = True
    return here.run(positions)


def web_forces(folder: Path, name: str, positions: np.ndarray, where: Path) -> tuple[np.ndarray, dict]:
    """Forces by Node."""
    given, found = where / "positions.bin", where / "forces.bin"
    given.write_bytes(np.ascontiguousarray(positions).tobytes())
    words = ["node", HARNESS, folder / "palpate.wasm", folder / "scenes" / f"{name}.palpate", given, found]
    ended = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    return np.frombuffer(found.read_bytes()).reshape(-1, 3), json.loads(ended.stdout)


@pytest.mark.parametrize("name", ["block", "liver", "beam"])
def test_forces_in_webassembly_are_the_native_ones_to_the_bit(site, tmp_path, name):
    folder, built, _ = site
    positions = drag(built[name])
    here = native_forces(built[name], positions)
    there, _ = web_forces(folder, name, positions, tmp_path)
    assert np.linalg.norm(here, axis=1).max() > 0.01, "a press that is felt"
    assert here.tobytes() == there.tobytes()


def test_program_and_liver_are_small(site):
    _, _, sizes = site
    assert sizes.program <= LARGEST_PROGRAM
    assert sizes.scenes["liver"] <= LARGEST_SCENE


def test_a_folder_of_something_else_is_not_replaced(site, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(palpate.Error, match="folder of something else"):
        write_site([("block", site[1]["block"])], tmp_path)
    assert find_program().is_file()


def waited(holds) -> None:
    """Wait until something holds."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, f"waited {PATIENCE} s in vain"
        time.sleep(0.05)


@contextlib.contextmanager
def served(folder: Path):
    """Address of a plain file server."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    handler.log_message = lambda *_: None  # type: ignore[attr-defined]
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@contextlib.contextmanager
def page_of(chromium, address: str):
    """A page in Chromium that draws, whose console has no error."""
    context = chromium.new_context(viewport={"width": 1100, "height": 700}, device_scale_factor=0.5)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(address)
    page.evaluate("() => window.palpate.ready")
    yield page
    assert not errors, errors
    context.close()


@pytest.mark.browser
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium")
class TestPage:
    """From a folder below the root of a file server."""

    @pytest.mark.slow
    def test_runs_drags_and_records(self, chromium, site, tmp_path):
        folder, built, _ = site
        with served(folder.parents[1]) as address, page_of(chromium, f"{address}/sub/site/index.html") as page:
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
            with page.expect_download() as download:
                page.evaluate("() => document.getElementById('record').click()")
            path = tmp_path / "page.mcap"
            download.value.save_as(path)
        again = simulation.replay(path, built["block"])
        assert again.ticks > 100
        assert again.same, again.differences[:3]

    def test_works_without_a_network_after_the_first_load(self, chromium, site):
        folder, _, _ = site
        with served(folder.parents[1]) as address, page_of(chromium, f"{address}/sub/site/") as page:
            kept = "async () => (await caches.keys()).length && (await (await caches.open('palpate')).keys()).length"
            waited(lambda: page.evaluate(kept) >= 5)
            page.context.set_offline(True)
            page.reload()
            page.evaluate("() => window.palpate.ready")
            assert page.evaluate("() => window.palpate.state().scene") == "block"
