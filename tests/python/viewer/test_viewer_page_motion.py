"""The page of a body in motion in a real Chromium: struck by itself and by clicks, slowed, and by modes."""

from __future__ import annotations

import numpy as np
import pytest
from browser import MARKS, Program, drawn, opened, press, state, until

pytestmark = MARKS


@pytest.fixture(scope="module")
def struck(cache):
    """The paper's beam in motion, struck by itself when a page opens."""
    started = Program(cache, "beam", "--paper", "--impulse")
    yield started
    assert started.stop() == 0


@pytest.fixture
def moving_page(chromium, struck):
    with opened(chromium, struck) as page:
        yield page


def swings(page, condition) -> tuple[np.ndarray, np.ndarray]:
    """Height of the marked node, m, and total energy, J, as often as the page is asked, up to a condition on both."""
    seen = []

    def met(s: dict) -> bool:
        motion = s["motion"]
        seen.append((motion["bodyTime"], motion["displacement"][2], motion["total"]))
        return condition(*np.array(seen).T[1:])

    until(page, met)
    return tuple(np.array(seen).T[1:])


@pytest.mark.slow
def test_the_impulse_is_given_and_repeated(moving_page):
    page = moving_page
    # Slowed down so that an eye follows 30 Hz.
    assert page.locator("#speed-10").get_attribute("aria-pressed") == "true"
    first = until(page, lambda s: s["motion"]["struck_at"] is not None and s["motion"]["total"] > 1e-4)["motion"]

    def swung_and_damped(height: np.ndarray, energy: np.ndarray) -> bool:
        crossings = np.count_nonzero(np.diff(np.sign(height)))
        return crossings >= 3 and np.abs(height).max() > 1e-4 and energy[-1] < 0.7 * energy.max()

    _, energy = swings(page, swung_and_damped)
    assert energy[-1] > 0
    # 10 N for a millisecond. How much work it does depends on how the node moves then; it may slow it down.
    before = state(page)["motion"]
    page.get_by_test_id("repeat").click()
    until(page, lambda s: s["motion"]["struck_at"] > before["struck_at"])
    again = until(page, lambda s: abs(s["motion"]["work"] - before["work"]) > 0.02 * before["work"])
    assert again["motion"]["watched"] == first["watched"]
    page.get_by_test_id("speed-4").click()
    until(page, lambda s: page.locator("#speed-4").get_attribute("aria-pressed") == "true")


def test_a_click_strikes_in_motion(moving_page):
    page = moving_page
    # The page gives the scene's own strike when it has been open for 0.8 s; its timers run in their order.
    page.evaluate("() => new Promise(resolve => setTimeout(resolve, 1000))")
    drawn(page)
    until(page, lambda s: s["motion"]["struck_at"] is not None)
    before = state(page)["motion"]
    x, y = page.evaluate("window.palpate.pickPoint()")
    page.get_by_test_id("strike").click()
    # A drag turns the camera, a click strikes, and neither presses.
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y, steps=4)
    page.mouse.up()
    assert state(page)["motion"]["struck_at"] == before["struck_at"]
    page.mouse.click(*page.evaluate("window.palpate.pickPoint()"))
    after = until(page, lambda s: s["motion"]["struck_at"] != before["struck_at"] and s["strain"] > 1e-3)
    assert after["contacts"] == 0 and after["motion"]["watched"] != before["watched"]
    page.get_by_test_id("strike").click()
    page.keyboard.down("Alt")
    page.mouse.click(*page.evaluate("window.palpate.pickPoint()"))
    page.keyboard.up("Alt")
    until(page, lambda s: s["motion"]["struck_at"] > after["motion"]["struck_at"])


@pytest.mark.slow
def test_modes_swing_one_by_one(moving_page):
    page = moving_page
    assert page.get_by_test_id("stiffness").is_disabled()
    assert "Fixed" in page.locator("#stiffness-field").get_attribute("title")
    page.get_by_test_id("tab-modes").click()
    third = page.get_by_test_id("mode-list").locator("button").nth(2)
    third.click()
    mode = until(page, lambda s: s["motion"]["mode"] is not None and s["strain"] > 0.01)["motion"]["mode"]
    assert mode["number"] == 3
    frequency = f"{mode['frequency']:.3g} Hz"
    assert frequency in third.inner_text()
    banner = page.get_by_test_id("mode-banner")
    assert f"Mode 3: {frequency}, shown slowed" in banner.inner_text()
    # Once a second, here, however rarely the page draws; the body itself rests.
    strains = []

    def swung(s: dict) -> bool:
        strains.append(s["strain"])
        return max(strains) > 2 * min(strains)

    until(page, swung)
    assert max(strains) <= 0.1 + 1e-6
    press(page)
    page.mouse.up()
    until(page, lambda s: s["motion"]["mode"] is None)
    assert not banner.is_visible()
