"""Pages without a server, for tests: a plain file server, a page in Chromium, scripted drags and the native forces."""

from __future__ import annotations

import contextlib
import functools
import http.server
import json
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
from browser import PATIENCE

import palpate
from palpate.viewer.tool_shapes import kind_of, radius_of

HARNESS = Path(__file__).resolve().parents[1] / "web_run.mjs"


def drag(built) -> np.ndarray:
    """Down onto the highest free place, of a level top its middle, and 15 mm along it: (600, 3) m.

    Two fifths of the tool's radius deep; the origin of a surface file is its middle.
    """
    body = built.bodies[0]
    green = body.green
    free = ~np.isin(green.surface_nodes, green.fixed_nodes)
    places = green.surface_positions[free]
    places = places[places[:, 2] > places[:, 2].max() - 1e-6]
    top = places[np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1))]
    tool = built.scene.tools[0]
    radius = radius_of(tool, built.scene.folder)
    front = radius if kind_of(tool) == "surface" else tool.reach
    above = np.concatenate([np.linspace(0.5, -0.4, 200), np.full(400, -0.4)])
    height = front + above * radius
    along = np.concatenate([np.zeros(200), np.linspace(0.0, 0.015, 400)])
    return body.points_to_scene(top + np.column_stack([0.3 * along, along, height]))


def native_forces(built, positions: np.ndarray) -> np.ndarray:
    """Forces of the same ticks here, strain measured by the surface as in a page."""
    here = palpate.Simulation(built)
    here._by_surface = True
    return here.run(positions)


def web_forces(
    folder: Path, name: str, positions: np.ndarray, where: Path, shape: str | None = None
) -> tuple[np.ndarray, dict]:
    """Forces by Node, of the first tool in its own shape or in another one that the page offers."""
    given, found = where / "positions.bin", where / "forces.bin"
    given.write_bytes(np.ascontiguousarray(positions).tobytes())
    words = ["node", HARNESS, folder / "palpate.wasm", folder / "scenes" / f"{name}.palpate", given, found, shape or ""]
    ended = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    return np.frombuffer(found.read_bytes()).reshape(-1, 3), json.loads(ended.stdout)


def waited(holds) -> None:
    """Wait until something holds."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, f"waited {PATIENCE} s in vain"
        time.sleep(0.05)


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    """Serves files, and prints nothing of it."""

    def log_message(self, *_) -> None:
        """Drop the line."""


@contextlib.contextmanager
def served(folder: Path):
    """Address of a plain file server."""
    handler = functools.partial(QuietHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@contextlib.contextmanager
def page_of(chromium, address: str, ready: str = "window.palpate.ready"):
    """A page in Chromium, whose console has no error, once something is ready in it."""
    context = chromium.new_context(viewport={"width": 1100, "height": 700}, device_scale_factor=0.5)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(address)
    page.evaluate(f"() => {ready}")
    yield page
    assert not errors, errors
    context.close()
