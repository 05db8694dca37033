"""Several bodies and several tools in the page, in a real Chromium."""

from __future__ import annotations

import asyncio
import threading
from pathlib import Path

import numpy as np
import pytest
from browser import MARKS, opened, press, settled_force, until
from pair_session import PairSession

import palpate
from palpate.viewer.server import ViewerServer
from palpate.viewer.session import Session

pytestmark = MARKS


class Pair:
    """A server with two livers, the second one beside the first and turned, and a tool for each."""

    def __init__(self, cache: Path):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("XDG_CACHE_HOME", str(cache))
            built = palpate.Scene(body={"model": "liver", "paper": True}).build(False)
            half = 0.5**0.5
            patch.setattr(
                "palpate.viewer.server.Session",
                lambda built: PairSession(Session(built), Session(built), (0.2, 0.02, 0.01), (half, 0.0, 0.0, half)),
            )
            self.server = ViewerServer(built, port=0)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._run(self.server.start())
        self.address = self.server.address

    def stop(self) -> None:
        self._run(self.server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    def _run(self, work) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(20)


@pytest.fixture(scope="module")
def pair(cache):
    started = Pair(cache)
    yield started
    started.stop()


def test_two_tools_on_two_bodies(chromium, pair):
    with opened(chromium, pair) as page:
        assert not page.get_by_test_id("pinned-line").is_visible()
        press(page, 30)
        alone = settled_force(page)
        page.keyboard.press("n")
        pinned = until(page, lambda s: s["pinned"] == [0])
        page.mouse.up()
        # The pointer drives the second tool now, on the body that it meets.
        x, y = page.evaluate("window.palpate.pickPoint(1)")
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(1, 16):
            page.mouse.move(x, y + step)
        second = until(page, lambda s: s["contacts"] == 2 and s["forceMagnitude"] > 0.05)
        assert second["pinned"] == [0]
        assert np.allclose(second["tools"][0]["position"], pinned["tools"][0]["position"], atol=1e-6)
        assert np.allclose(second["tools"][0]["force"], alone, rtol=1e-3)
        assert second["force"] == second["tools"][1]["force"] and second["force"][2] > 0
        told = page.get_by_test_id("pinned-line").inner_text()
        assert float(told.split()[1]) == pytest.approx(np.linalg.norm(alone), rel=0.02)
        # Letting go of the second leaves the first; Escape takes that too.
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 1 and s["tools"][0]["active"] and not s["tools"][1]["active"])
        page.keyboard.press("Escape")
        until(page, lambda s: s["contacts"] == 0 and s["pinned"] == [])


def test_a_pinned_tool_by_buttons(chromium, pair):
    with opened(chromium, pair) as page:
        pin, release = page.get_by_test_id("pin"), page.locator("#unpin")
        assert release.is_disabled()
        for letting_go in (pin, release):
            pin.click()
            assert pin.get_attribute("aria-pressed") == "true"
            press(page, 20)
            page.mouse.up()
            until(page, lambda s: s["pinned"] == [0] and s["contacts"] == 1)
            letting_go.click()
            until(page, lambda s: s["pinned"] == [] and s["contacts"] == 0)
            assert pin.get_attribute("aria-pressed") == "false"


def test_stiffness_and_legend_are_those_of_the_chosen_body(chromium, pair):
    with opened(chromium, pair) as page:
        press(page, 20)
        limit = page.locator("#legend-max")
        until(page, lambda s: s["field"]["max"] > 2)
        first = float(limit.inner_text())
        page.get_by_test_id("body-select").select_option(index=1)
        assert float(limit.inner_text()) < first
        page.mouse.up()
        slider = page.get_by_test_id("stiffness")
        slider.evaluate("e => { e.value = 1; e.dispatchEvent(new Event('input', {bubbles: true})); }")
        assert page.locator("#stiffness-value").inner_text() == "100 kPa"
        page.get_by_test_id("body-select").select_option(index=0)
        assert page.locator("#stiffness-value").inner_text() == "10.0 kPa"
        until(page, lambda _: [s.simulation.youngs_modulus for s in pair.server._session.sessions] == [10e3, 100e3])
