"""What large surfaces cost the viewer: frames as they are sent, and a page that draws them.

A dome with a dent that goes in and out stands for a body: no compliance is needed, for what is measured comes after the
displacements. The page is Chromium, where it and Playwright are there.
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from benches.output import Table
from palpate import models
from palpate.scene import BuiltScene, model_scene
from palpate.validation.doctor.measure import browser_page
from palpate.viewer import messages
from palpate.viewer import shown_body as drawing
from palpate.viewer.fields import DISPLACEMENT, Picture
from palpate.viewer.server import ViewerServer
from palpate.viewer.session import Session
from palpate.viewer.shown_body import ShownBody, drawn_surface

TRIANGLES = (20_000, 100_000, 500_000)
# Width and height of the dome, m; depth of the dent, its radius, and how often a second it goes in.
WIDTH, HEIGHT, DEPTH, RADIUS, PRESSING_HZ = 0.2, 0.05, 0.01, 0.01, 1.0
# Frames that are coded, at 60 a second.
FRAMES = 60
# How long a page is watched, s, and how long it is waited for.
WATCHED, PATIENCE = 8.0, 120.0


@dataclass(frozen=True)
class Row:
    """A surface and how it is drawn.

    Attributes
    ----------
    triangles, drawn
        Of the surface, and of what is drawn.
    simplify_s
        Time to find what is drawn.
    scene_mb
        Length of the message with the geometry.
    frame_kb
        Length of a frame's poses.
    code_ms
        Time to write a frame.
    frames_per_second
        That the page draws; None without Chromium.
    move_ms
        Of a frame, in the page: to move what is drawn; the rest is drawing.

    """

    triangles: int
    drawn: int
    simplify_s: float
    scene_mb: float
    frame_kb: float
    code_ms: float
    frames_per_second: float | None = None
    move_ms: float | None = None


def run(
    triangles: Sequence[int] = TRIANGLES, most: Sequence[int | None] = (None, drawing.MOST_TRIANGLES), page: bool = True
) -> list[Row]:
    """Measure domes of so many triangles, each drawn by at most so many; None draws all of them."""
    rows = []
    for count in triangles:
        for limit in most:
            if limit is None or limit < count:
                rows.append(_measure(Dome(count, sys.maxsize if limit is None else limit), page))
    return rows


def as_table(rows: Sequence[Row]) -> Table:
    """Return one line per dome and number of triangles drawn."""
    lines = []
    for row in rows:
        cells = [
            f"{row.triangles:,}",
            f"{row.drawn:,}",
            f"{row.scene_mb:.1f}",
            f"{row.frame_kb:.0f}",
            f"{row.code_ms:.1f}",
        ]
        page = (row.frames_per_second, row.move_ms)
        lines.append([*cells, *("-" if value is None else f"{value:.1f}" for value in page)])
    headings = ["triangles", "drawn", "scene MB", "frame kB", "code ms", "frames/s", "move ms"]
    return Table("Large surfaces in the page", headings, lines, words=0)


class Dome:
    """Surface of about so many triangles, of which at most so many are drawn."""

    def __init__(self, triangles: int, most: int):
        cells = round((triangles / 2) ** 0.5)
        axis = np.linspace(-WIDTH / 2, WIDTH / 2, cells + 1)
        x, y = (part.ravel() for part in np.meshgrid(axis, axis, indexing="ij"))
        self.places = np.column_stack([x, y, HEIGHT * np.exp(-(x**2 + y**2) / (WIDTH / 4) ** 2)])
        low = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
        a, b, c, d = low, low + cells + 1, low + cells + 2, low + 1
        corners = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        green = SimpleNamespace(
            surface_nodes=np.arange(len(self.places)),
            surface_triangles=corners,
            surface_positions=self.places,
            fixed_nodes=np.zeros(0, dtype=int),
            free_displacements=np.zeros_like(self.places),
            extents=np.ptp(self.places, axis=0),
        )
        built: Any = SimpleNamespace(green=green, body=None, name="dome", position=(0, 0, 0), orientation=(1, 0, 0, 0))
        started = time.perf_counter()
        self.drawn = drawn_surface(built, np.zeros(0, dtype=int), most)
        self.simplify_s = time.perf_counter() - started
        self.shown = ShownBody(built, _Displacement(), self.drawn)  # type: ignore[arg-type]
        # A half-space falls off with the distance: almost all of it moves a little.
        away = np.hypot(x - WIDTH / 10, y)
        self._dent = np.zeros_like(self.places)
        self._dent[:, 2] = -DEPTH / np.sqrt(1 + (away / RADIUS) ** 2)

    def displacements(self, seconds: float) -> np.ndarray:
        """Displacements (s, 3), m, at a time."""
        return 0.5 * (1 - np.cos(2 * np.pi * PRESSING_HZ * seconds)) * self._dent


class _Displacement:
    """The only field of a dome."""

    offered = (DISPLACEMENT,)

    def picture(self, _name: str, displacements: np.ndarray, _interior: bool, _full_scale: float | None) -> Picture:
        sizes = np.sqrt(np.einsum("ij,ij->i", displacements, displacements))
        known = {name: getattr(DISPLACEMENT, name) for name in ("name", "title", "unit", "signed", "gaps")}
        header = {**known, "min": 0.0, "max": 1e3 * DEPTH, "largest": 1e3 * float(sizes.max())}
        return Picture(header, displacements, np.rint(255.0 * np.minimum(sizes / DEPTH, 1.0)), False)

    def largest_strain(self, _displacements: np.ndarray) -> float:
        return 0.0


class DomeSession(Session):
    """A session that shows a dome in the place of its body."""

    def __init__(self, built: BuiltScene, dome: Dome):
        self._dome = dome
        super().__init__(built)
        self.size = WIDTH

    def _shown(self, body: int) -> ShownBody:
        return self._dome.shown

    def _pose(self, frame: Any, body: int) -> np.ndarray:
        return self._dome.displacements(time.monotonic())


def _measure(dome: Dome, page: bool) -> Row:
    times = []
    for frame in range(FRAMES):
        picture = dome.shown.picture("", dome.displacements(frame / 60), False, None)
        started = time.perf_counter()
        message = messages.encode({}, messages.numbered([picture.arrays]))
        times.append(time.perf_counter() - started)
    scene = messages.encode({}, messages.numbered([dome.shown.arrays()]))
    row = Row(
        triangles=len(dome.shown.built.green.surface_triangles),
        drawn=len(dome.drawn.triangles),
        simplify_s=dome.simplify_s,
        scene_mb=1e-6 * len(scene),
        frame_kb=1e-3 * len(message),
        code_ms=1e3 * float(np.median(times[1:])),
    )
    drawn = asyncio.run(_on_a_page(dome)) if page else None
    return row if drawn is None else Row(**{**asdict(row), **drawn})


async def _on_a_page(dome: Dome) -> dict[str, float] | None:
    """Frames a second and times of a frame in Chromium; None without it."""
    built = await asyncio.to_thread(model_scene(models.NAMES[-1], True).build, False)
    server = ViewerServer(DomeSession(built, dome), port=0)
    await server.start()
    try:
        async with browser_page(server.address) as page:
            if page is None:
                return None
            await _until(page, lambda state: state["frames"] > 3)
            first, begun = await _state(page), time.monotonic()
            await asyncio.sleep(WATCHED)
            await _until(page, lambda state: state["frames"] > first["frames"])
            last, seconds = await _state(page), time.monotonic() - begun
    finally:
        await server.stop()
    frames = last["frames"] - first["frames"]
    return {"frames_per_second": frames / seconds, "move_ms": (last["tookMs"] - first["tookMs"]) / frames}


async def _state(page: Any) -> dict[str, Any]:
    return await page.evaluate("window.palpate ? window.palpate.state() : {frames: 0}")


async def _until(page: Any, condition: Callable[[dict[str, Any]], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition(await _state(page)):
        if time.monotonic() > end:
            raise RuntimeError(f"the page drew no frame in {PATIENCE:.0f} s")
        await asyncio.sleep(0.05)
