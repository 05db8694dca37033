"""Brush and lasso in a real Chromium, on a surface of which a disc is ready and the rest still computed."""

from __future__ import annotations

import asyncio
import base64
import threading
import time
from typing import Any

import numpy as np
import pytest
from browser import MARKS, PATIENCE, drawn, opened, until

import palpate
from benches.surfaces import Dome, DomeSession
from palpate.scene import BuiltScene
from palpate.viewer.computing import Computing, mask_text
from palpate.viewer.server import ViewerServer

pytestmark = MARKS

# Middle and radius of what is ready, m.
READY, REACH = (0.03, 0.0), 0.03
# What has a smaller x is never computed, m.
OUTSIDE = -0.07


class StandingComputing(Computing):
    """Half of the columns are computed, and no more come; keeps what is painted."""

    def __init__(self, ready: np.ndarray, region: np.ndarray):
        super().__init__()
        self.ready, self.region, self.painted = ready, region, np.zeros(len(ready), dtype=bool)

    def step(self, session: Any) -> dict[str, Any]:
        return self.message(session)

    def message(self, session: Any) -> dict[str, Any]:
        entry = {"ready": mask_text(self.ready), "region": mask_text(self.region), "waiting": mask_text(self.painted)}
        return {
            "type": "computed",
            "bodies": [{**entry, "done": 300, "columns": 600, "left_s": 130.0, "stopped": None}],
            "series": None,
        }

    def paint(self, session: Any, message: Any) -> None:
        bits = np.unpackbits(np.frombuffer(base64.b64decode(message["nodes"]), np.uint8), bitorder="little")
        self.painted[message["first"] + np.flatnonzero(bits)] = True


class Served:
    """A page's server on a thread of its own; ``address`` is what a browser opens."""

    def __init__(self, dome: Dome, built: BuiltScene):
        dome.displacements = lambda _seconds: np.zeros_like(dome.places)  # type: ignore[method-assign]
        self.dome, self._loop = dome, asyncio.new_event_loop()
        self.thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self.thread.start()
        self.address = self._do(self._start(built))

    async def _start(self, built: BuiltScene) -> str:
        self.server = ViewerServer(DomeSession(built, self.dome), port=0)
        away = np.linalg.norm(self.dome.places[:, :2] - READY, axis=1)
        self.computing = self.server._computing = StandingComputing(away < REACH, self.dome.places[:, 0] > OUTSIDE)
        await self.server.start()
        return self.server.address

    def stop(self) -> None:
        self._do(self.server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self.thread.join()
        self._loop.close()

    def _do(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE)


@pytest.fixture(params=[(5000, 60_000), (20_000, 4000)], ids=["whole", "fewer triangles"])
def served(request, block, block_green):
    built = BuiltScene.of(palpate.Scene.of_store("block.palpate"), block, block_green)
    server = Served(Dome(*request.param), built)
    yield server
    server.stop()


def place(page, point) -> tuple[float, float]:
    return page.evaluate("point => window.palpate.project(point)", [float(x) for x in point])


def on_dome(dome: Dome, x: float, y: float) -> np.ndarray:
    return dome.places[np.argmin(np.linalg.norm(dome.places[:, :2] - [x, y], axis=1))]


def count(page, state: str) -> int:
    return int((page.get_by_test_id(f"paint-count-{state}").inner_text() or "0").replace(",", ""))


def line(page, *places: tuple[float, float]) -> None:
    page.mouse.move(*places[0])
    page.mouse.down()
    for x, y in places[1:]:
        page.mouse.move(x, y, steps=5)
    page.mouse.up()


@pytest.mark.slow
def test_what_is_painted_is_asked_for(chromium, served):
    dome, computing = served.dome, served.computing
    with opened(chromium, served) as page:
        assert page.get_by_test_id("paint-left").inner_text() == "50 % computed, about 2 min left"
        assert count(page, "ready") == computing.ready.sum()
        assert count(page, "never") == (~computing.region).sum() > 0
        start, end = on_dome(dome, -0.03, -0.05), on_dome(dome, 0.01, -0.05)
        page.keyboard.press("b")
        line(page, place(page, start), place(page, end))
        drawn(page)
        brushed = count(page, "painted")
        page.keyboard.press("l")
        corners = [on_dome(dome, x, y) for x, y in ((0.05, -0.09), (0.09, -0.09), (0.09, -0.06), (0.05, -0.06))]
        line(page, *(place(page, corner) for corner in corners))
        drawn(page)
        assert count(page, "painted") > brushed > 0
        page.keyboard.press("u")
        assert count(page, "painted") == brushed
        line(page, *(place(page, corner) for corner in corners))
        drawn(page)
        both = count(page, "painted")
        page.keyboard.press("Enter")
        end_time = time.monotonic() + 30
        while count(page, "waiting") < both and time.monotonic() < end_time:
            time.sleep(0.05)
        assert computing.painted.sum() == both == count(page, "waiting") and count(page, "painted") == 0
        # What was asked for is where the pointer was: the brush's way, and inside of the lasso.
        spacing = 0.2 / np.sqrt(len(dome.drawn.triangles) / 2)
        x, y = dome.places[:, 0], dome.places[:, 1]
        lasso = (np.abs(x - 0.07) < 0.02 + 2 * spacing) & (np.abs(y + 0.075) < 0.015 + 2 * spacing)
        inner = (np.abs(x - 0.07) < 0.02 - 2 * spacing) & (np.abs(y + 0.075) < 0.015 - 2 * spacing)
        way = (np.abs(x + 0.01) < 0.02 + 0.02) & (np.abs(y + 0.05) < 0.025)
        assert inner.sum() > 5 and computing.painted[inner].all()
        assert not computing.painted[~lasso & ~way].any()
        middle = (np.abs(x + 0.01) < 0.02) & (np.abs(y + 0.05) < 1.01 * spacing)
        assert computing.painted[middle].all()
        # A page that is opened anew knows it, too.
        page.reload()
        until(page, lambda state: state["frames"] > 3)
        assert count(page, "waiting") == both


@pytest.mark.quick(2)
def test_what_is_ready_is_not_painted_and_escape_gives_the_pointer_back(chromium, served):
    dome = served.dome
    with opened(chromium, served) as page:
        page.keyboard.press("b")
        x, y = place(page, on_dome(dome, *READY))
        for _ in range(4):
            page.keyboard.press("[")
        line(page, (x, y), (x + 2, y))
        drawn(page)
        assert count(page, "painted") == 0
        # Nor is what is never computed.
        line(page, *(place(page, on_dome(dome, -0.09, y)) for y in (-0.02, 0.0)))
        drawn(page)
        assert count(page, "painted") == 0
        page.keyboard.press("Escape")
        assert page.get_by_test_id("paint-brush").get_attribute("aria-pressed") == "false"
        line(page, place(page, on_dome(dome, -0.05, -0.05)), place(page, on_dome(dome, -0.04, -0.05)))
        assert count(page, "painted") == 0
