"""The widget of notebooks: its page in Chromium without Jupyter, and a notebook that is run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from browser import PATIENCE
from web_site import drag, native_forces, page_of, served

import palpate

BLOCK = Path(__file__).resolve().parents[3] / "examples" / "block.toml"
# What Jupyter does: a model with the values from Python, and a place to render into.
HOST = """<!doctype html><html><head><link rel="icon" href="data:,"></head><body><script type="module">
import widget from "./widget.mjs";
const values = await (await fetch("values.json")).json();
for (const name of ["program", "scene"]) values[name] = new DataView(await (await fetch(name)).arrayBuffer());
const model = { get: (name) => values[name], on() {}, off() {}, set() {}, save_changes() {} };
const el = document.createElement("div");
document.body.append(el);
window.clean = widget.render({ model, el });
const frame = el.querySelector("iframe");
window.ready = new Promise((resolve) => {
  const look = () => {
    const { palpate } = frame.contentWindow;
    return palpate ? palpate.ready.then(resolve) : setTimeout(look, 20);
  };
  look();
});
window.run = async (positions) => Array.from(await frame.contentWindow.palpate.run(Float64Array.from(positions)));
</script></body></html>"""


@pytest.fixture
def built(shared_cache):
    return palpate.Scene.read(BLOCK).build(progress=False)


@pytest.mark.browser
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium")
@pytest.mark.slow
def test_the_widget_runs_the_scene_to_the_bit(chromium, built, tmp_path):
    widget = palpate.widget(built, height=300)
    texts = {name: getattr(widget, name) for name in ("page", "script", "worker", "height")}
    (tmp_path / "values.json").write_text(json.dumps(texts))
    (tmp_path / "program").write_bytes(widget.program)
    (tmp_path / "scene").write_bytes(widget.scene)
    (tmp_path / "widget.mjs").write_text(str(widget._esm))
    (tmp_path / "index.html").write_text(HOST)
    positions = drag(built)
    with served(tmp_path) as address, page_of(chromium, f"{address}/index.html", "null") as page:
        page.wait_for_function("window.ready", timeout=1e3 * PATIENCE)
        page.evaluate("() => window.ready")
        assert page.locator("iframe").bounding_box()["height"] == 300
        forces = page.evaluate("(p) => window.run(p)", positions.ravel().tolist())
        page.evaluate("() => window.clean()")
    assert np.array(forces).tobytes() == native_forces(built, positions).tobytes()


@pytest.mark.slow
def test_a_notebook_shows_the_widget(shared_cache):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    cell = nbformat.v4.new_code_cell(f"import palpate\npalpate.widget({str(BLOCK)!r})")
    notebook = nbformat.v4.new_notebook(cells=[cell])
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    (shown,) = [output for output in notebook.cells[0].outputs if output.output_type == "execute_result"]
    assert "application/vnd.jupyter.widget-view+json" in shown.data


def test_a_page_that_is_not_as_expected_is_refused(built, tmp_path, monkeypatch):
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<html></html>")
    monkeypatch.setattr("palpate.viewer.site.static_folder", lambda: tmp_path)
    with pytest.raises(palpate.Error, match="make viewer"):
        palpate.widget(built)
