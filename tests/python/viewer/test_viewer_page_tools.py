"""Tools of other shapes in the page: chosen from the list, held at an angle, turned by hand while they press."""

from __future__ import annotations

import numpy as np
import pytest
from browser import MARKS, Program, drag, press, settled_depth, settled_force, state, until

from palpate.vectors import rotated

pytestmark = MARKS


@pytest.fixture(scope="module")
def program(cache):
    started = Program(cache, "kidney", "--paper")
    yield started
    assert started.stop() == 0


def choose(page, shape: str) -> None:
    """Choose a shape, and wait for the loop with that tool."""
    page.get_by_test_id("shape-select").select_option(shape)
    until(page, lambda s: s["shape"] == shape, 60)
    page.get_by_test_id("status").wait_for(state="hidden", timeout=60_000)


def axis_of(page) -> np.ndarray:
    """Where the driven tool's z points."""
    return rotated(np.array([0.0, 0.0, 1.0]), state(page)["tools"][0]["orientation"])


def slide_to(page, name: str, value: float) -> None:
    page.get_by_test_id(name).evaluate(
        "(e, value) => { e.value = value; e.dispatchEvent(new Event('input', {bubbles: true})); }", value
    )


@pytest.mark.slow
def test_a_stylus_lies_on_the_body_and_is_turned_by_hand(page):
    assert page.get_by_test_id("tilt").is_hidden()  # a sphere is the same from all sides
    choose(page, "capsule")
    x, y = page.evaluate("window.palpate.pickPoint()")
    press(page)
    assert page.locator("#tilt-value").input_value() == "90°"
    normal = settled_force(page)
    normal /= np.linalg.norm(normal)
    lying = axis_of(page)
    assert abs(lying @ normal) < 0.3
    depth = settled_depth(page)
    # Alt: 100 pixels sideways turn it by 50 degrees about the normal, in place.
    page.keyboard.down("Alt")
    drag(page, (x, y), (x + 100, y))
    page.keyboard.up("Alt")
    settled_force(page)
    assert page.locator("#turn-value").input_value() == "50°"
    assert np.degrees(np.arccos(lying @ axis_of(page))) == pytest.approx(50, abs=3)
    assert settled_depth(page) == depth and state(page)["contacts"] == 1
    page.keyboard.down("Alt")
    drag(page, (x + 100, y), (x + 100, y - 180))
    page.keyboard.up("Alt")
    settled_force(page)
    assert page.locator("#tilt-value").input_value() == "0°"
    assert axis_of(page) @ normal > 0.9
    # A drag without Alt slides on from where it was, not from under the pointer.
    before = np.array(state(page)["tools"][0]["position"])
    drag(page, (x + 100, y - 180), (x + 102, y - 180))
    settled_force(page)
    assert np.linalg.norm(np.array(state(page)["tools"][0]["position"]) - before) < 5e-3
    page.mouse.up()
    until(page, lambda s: s["contacts"] == 0)


@pytest.mark.slow
def test_a_flat_punch_is_stiffer_than_a_ball_and_softer_on_its_rim(page):
    forces = {}
    for shape, tilt in (("sphere", 0), ("punch", 0), ("punch", 40)):
        choose(page, shape)
        if shape == "punch":
            slide_to(page, "tilt", tilt)
        press(page)
        forces[shape, tilt] = np.linalg.norm(settled_force(page))
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0)
    assert forces["punch", 0] > 1.3 * forces["sphere", 0]
    assert forces["punch", 0] > 1.3 * forces["punch", 40] > 0
