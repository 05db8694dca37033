"""Several bodies and several tools in the page, in a real Chromium."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from browser import MARKS, PATIENCE, Program, opened, press, settled_force, state, until

import palpate
from palpate.viewer.server import ViewerServer

pytestmark = MARKS

HALF = 0.5**0.5
TWO_LIVERS = [
    {"model": "liver", "paper": True},
    {
        "model": "liver",
        "paper": True,
        "name": "second liver",
        "position": (0.2, 0.02, 0.01),
        "orientation": (HALF, 0.0, 0.0, HALF),
    },
]


class Pair:
    """A server with two livers, the second one beside the first and turned, and two tools."""

    def __init__(self, cache: Path):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("XDG_CACHE_HOME", str(cache))
            scene = palpate.Scene(body=TWO_LIVERS, tool=[{}, {}])
            self.server = ViewerServer(scene.build(False), port=0)
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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("palpate.viewer.server.LOST_AFTER", PATIENCE)
        started = Pair(cache)
        yield started
        started.stop()


@pytest.mark.slow
def test_two_tools_on_two_bodies(chromium, pair):
    with opened(chromium, pair) as page:
        assert not page.get_by_test_id("pinned-line").is_visible()
        press(page, 5)
        alone = settled_force(page)
        page.keyboard.press("n")
        pinned = until(page, lambda s: s["pinned"] == [0])
        page.mouse.up()
        # The pointer drives the second tool now, on the body that it meets.
        press(page, place=page.evaluate("window.palpate.pickPoint(1)"), contacts=2)
        settled_force(page)
        second = state(page)
        assert second["pinned"] == [0]
        assert np.allclose(second["tools"][0]["position"], pinned["tools"][0]["position"], atol=1e-6)
        # Bodies do not feel each other.
        assert np.allclose(second["tools"][0]["force"], alone, rtol=1e-3)
        assert second["force"] == second["tools"][1]["force"] and second["force"][2] > 0
        shown = float(page.locator("#pinned-value").inner_text())
        assert shown == pytest.approx(np.linalg.norm(alone), abs=0.006)
        # Letting go of the second leaves the first; Escape takes that too.
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 1 and s["tools"][0]["active"] and not s["tools"][1]["active"])
        page.keyboard.press("Escape")
        until(page, lambda s: s["contacts"] == 0 and s["pinned"] == [])


@pytest.mark.slow
def test_a_second_finger_feels_the_dent_of_the_first(page):
    """By `f2 = delta / (c22 - c21 c12 / c11)`: the first finger holds the body against the second.

    ``delta`` is how far the second finger goes below the dent that it meets; without the first one it is
    `f2 = delta / c22`.
    """
    x, y = page.evaluate("window.palpate.pickPoint()")
    beside = x - 40, y + 40
    press(page, place=beside)
    alone = settled_force(page)
    page.mouse.up()
    until(page, lambda s: s["contacts"] == 0)
    press(page, place=(x, y))
    first = settled_force(page)
    page.keyboard.press("n")
    until(page, lambda s: s["pinned"] == [0])
    page.mouse.up()
    press(page, place=beside, contacts=2)
    second = settled_force(page)
    assert np.linalg.norm(second) > 1.01 * np.linalg.norm(alone)
    # What the second finger presses away, the first one need not.
    assert np.linalg.norm(state(page)["tools"][0]["force"]) < 0.99 * np.linalg.norm(first)
    page.mouse.up()
    until(page, lambda s: s["contacts"] == 1)
    page.keyboard.press("n")
    until(page, lambda s: s["contacts"] == 0 and s["pinned"] == [])


@pytest.mark.slow
def test_a_pinned_tool_by_buttons(chromium, pair):
    with opened(chromium, pair) as page:
        pin, release = page.get_by_test_id("pin"), page.locator("#unpin")
        assert release.is_disabled()
        for letting_go in (pin, release):
            pin.click()
            assert pin.get_attribute("aria-pressed") == "true"
            press(page)
            page.mouse.up()
            until(page, lambda s: s["pinned"] == [0] and s["contacts"] == 1)
            letting_go.click()
            until(page, lambda s: s["pinned"] == [] and s["contacts"] == 0)
            assert pin.get_attribute("aria-pressed") == "false"


@pytest.mark.slow
def test_stiffness_and_legend_are_those_of_the_chosen_body(chromium, pair):
    with opened(chromium, pair) as page:
        press(page, 8)
        limit = page.locator("#legend-max")
        until(page, lambda s: s["field"]["max"] > 2)
        first = float(limit.input_value())
        page.get_by_test_id("body-select").select_option(index=1)
        assert float(limit.input_value()) < first
        page.mouse.up()
        slider = page.get_by_test_id("stiffness")
        slider.evaluate("e => { e.value = 1; e.dispatchEvent(new Event('input', {bubbles: true})); }")
        assert page.locator("#stiffness-value").input_value() == "100 kPa"
        page.get_by_test_id("body-select").select_option(index=0)
        assert page.locator("#stiffness-value").input_value() == "10.0 kPa"
        simulation = pair.server._session.simulation
        until(page, lambda _: [simulation.youngs_modulus_of(body) for body in (0, 1)] == [10e3, 100e3])


@pytest.mark.slow
def test_no_second_tool_is_offered_where_there_is_one(chromium, cache):
    started = Program(cache, "beam", "--paper", "--impulse")
    with opened(chromium, started) as page:
        assert not page.locator("#fingers").is_visible() and not page.locator("#body-row").is_visible()
        press(page)
        page.keyboard.press("n")
        time.sleep(0.2)
        assert state(page)["pinned"] == []
        # The beam swings: it may leave the finger for a moment.
        until(page, lambda s: s["contacts"] == 1)
        page.mouse.up()
    assert started.stop() == 0
