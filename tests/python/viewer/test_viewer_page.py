"""The viewer's page in a real Chromium, driven by Playwright, against the program that a user starts."""

from __future__ import annotations

import http.server
import threading
import time

import numpy as np
import pytest
from browser import (
    MARKS,
    MORE_OPEN,
    Program,
    drag,
    drawn,
    opened,
    press,
    settled_depth,
    settled_force,
    state,
    until,
    wheel,
)

import palpate

pytestmark = MARKS


def displayed(page) -> float:
    return float(page.get_by_test_id("force-value").inner_text().replace("\u2212", "-"))


def test_a_press_is_felt_shown_and_released(page, capsys):
    assert displayed(page) == 0.0
    before, started = state(page), time.monotonic()
    x, y = page.evaluate("window.palpate.pickPoint()")
    pressed = press(page)
    drag(page, (x, y), (x - 10, y), 15)
    moved, took = state(page), time.monotonic() - started
    # Pressed from above: the device is pushed up, the body's force on it has the sign of the outward normal.
    assert pressed["force"][2] > 0
    force = settled_force(page)
    assert displayed(page) == pytest.approx(np.linalg.norm(force), abs=0.006)
    page.mouse.up()
    until(page, lambda s: s["contacts"] == 0 and s["force"] == [0, 0, 0])
    time.sleep(0.3)
    assert displayed(page) == 0.0
    frames, pointer = (moved[k] - before[k] for k in ("frames", "pointerEvents"))
    with capsys.disabled():
        print(f"\n  {frames / took:.0f} frames applied/s, {pointer / took:.0f} pointer events/s (software GL)")


def test_the_size_of_the_body_is_told(page):
    sides = np.ptp(palpate.models.load("liver", paper=True).nodes, axis=0)
    text = page.get_by_test_id("legend-size").inner_text()
    assert text.startswith("Body of ") and text.endswith(" mm")
    result = [float(number) for number in text.removeprefix("Body of ").removesuffix(" mm").split(" × ")]
    assert result == pytest.approx(1e3 * sides, rel=6e-4)


RADIUS = 10e-3  # of the liver's tools


def shown(page, name: str) -> float:
    """Number that the page tells first under a test id."""
    return float(page.get_by_test_id(name).inner_text().split()[0].replace(",", "").replace("\u2212", "-"))


@pytest.mark.slow
def test_a_press_begins_at_the_surface_and_comes_to_a_gentle_depth(page):
    x, y = page.evaluate("window.palpate.pickPoint()")
    # Seen by the page itself, from the event on: it may be long until a test sees it.
    page.evaluate(
        """() => { const see = () => window.depths.push(window.palpate.state().depth);
                   const begin = () => { setTimeout(see); setInterval(see, 4); };
                   window.depths = [];
                   window.addEventListener("pointerdown", begin, {capture: true, once: true}); }"""
    )
    page.mouse.move(x, y)
    page.mouse.down()
    until(page, lambda s: s["depth"] >= 0.99 * 0.4 * RADIUS)
    depths = page.evaluate("window.depths")
    assert len(depths) > 1 and depths[0] < 0.1 * RADIUS and (np.diff(depths) >= 0).all()
    assert settled_depth(page) == pytest.approx(0.4 * RADIUS, rel=1e-6)
    settled_force(page)
    # The loop's own depth, below its smooth surface, is the one that the page asked for below its own.
    assert shown(page, "depth-value") == pytest.approx(4.0, abs=0.15)
    page.mouse.up()


def test_a_drag_slides_along_the_surface(page):
    """The tool stays under the pointer, at the same depth."""
    x, y = page.evaluate("window.palpate.pickPoint()")
    x, y = x - 20, y + 70
    press(page, place=(x, y))
    before = np.array(state(page)["tools"][0]["position"])
    drag(page, (x, y), (x + 60, y + 20), 15)
    assert shown(page, "contact-value") > 0
    assert page.get_by_test_id("contact-slides").inner_text() in {"slides", "sticks"}
    settled_force(page)
    after = np.array(state(page)["tools"][0]["position"])
    moved = after - before
    assert np.linalg.norm(moved) > RADIUS
    seen = page.evaluate("point => window.palpate.project(point)", after.tolist())
    start = page.evaluate("point => window.palpate.project(point)", before.tolist())
    assert np.subtract(seen, start) == pytest.approx([60, 20], abs=8)
    assert settled_depth(page) == pytest.approx(0.4 * RADIUS, rel=1e-6)
    assert shown(page, "depth-value") == pytest.approx(4.0, abs=0.15)
    # Rolls off beside the body, and comes back.
    outside = page.locator("#canvas").bounding_box()
    edge = (outside["x"] + 0.5 * outside["width"], outside["y"] + 15)
    drag(page, (x + 60, y + 20), edge, 15)
    until(page, lambda s: s["contacts"] == 0)
    drag(page, edge, (x, y), 15)
    until(page, lambda s: s["contacts"] == 1)
    page.mouse.up()


@pytest.mark.slow
def test_the_depth_is_told_by_wheel_second_button_and_shift(page):
    x, y = page.evaluate("window.palpate.pickPoint()")
    press(page)
    first = settled_force(page)
    wheel(page, 300)
    assert settled_depth(page) == pytest.approx(0.7 * RADIUS, rel=1e-6)
    assert np.linalg.norm(settled_force(page)) > 1.3 * np.linalg.norm(first)
    place = np.array(state(page)["tools"][0]["position"])
    page.mouse.down(button="right")
    drag(page, (x, y), (x + 15, y - 20))
    page.mouse.up(button="right")
    assert settled_depth(page) < 0.69 * RADIUS
    settled_force(page)
    # Along the normal alone, which points upwards there.
    moved = np.array(state(page)["tools"][0]["position"]) - place
    assert moved[2] > 0 and np.hypot(*moved[:2]) < moved[2]
    page.mouse.up()
    until(page, lambda s: s["contacts"] == 0)
    page.keyboard.down("Shift")
    page.mouse.move(x, y)
    page.mouse.down()
    time.sleep(0.7)
    drawn(page)
    assert state(page)["depth"] == pytest.approx(0, abs=1e-9)
    drag(page, (x, y), (x, y + 60))
    assert settled_depth(page) > 0.1 * RADIUS
    page.mouse.up()
    page.keyboard.up("Shift")


def choose_field(page, name: str) -> dict:
    page.get_by_test_id("field-select").select_option(name)
    return until(page, lambda s: s["field"] and s["field"]["name"] == name)["field"]


@pytest.mark.slow
def test_felt_stiffness_is_the_slope_of_force_against_depth(page):
    forces, stiffness, depths = [], [], []
    press(page)
    for _ in range(3):
        forces.append(np.linalg.norm(settled_force(page)))
        stiffness.append(shown(page, "stiffness-felt"))
        depths.append(1e3 * state(page)["depth"])
        wheel(page, 50)
        settled_depth(page)
    page.mouse.up()
    slope = (forces[2] - forces[0]) / (depths[2] - depths[0])
    assert stiffness[0] < stiffness[1] < stiffness[2]
    assert stiffness[1] == pytest.approx(slope, rel=0.05)


def slide_to(page, name: str, value: float) -> None:
    page.get_by_test_id(name).evaluate(
        "(e, value) => { e.value = value; e.dispatchEvent(new Event('input', {bubbles: true})); }", value
    )


@pytest.mark.slow
def test_a_press_is_held_at_the_chosen_strain(page):
    notice, strain = page.get_by_test_id("limit-notice"), page.get_by_test_id("strain-value")
    assert page.locator("#strain-limit-value").input_value() == "30 %"
    assert notice.is_hidden()
    slide_to(page, "strain-limit", 10)
    press(page, 15)
    until(page, lambda s: s["limited"] and s["strain"] > 0.08)
    first, deep = settled_force(page), settled_depth(page)
    assert notice.inner_text() == "Held at 10 % strain"
    # Where the limit is watched and where the page looks are not the same points: without it the strain is 20 %.
    assert 8 <= float(strain.inner_text()) <= 12
    # Deeper than half a radius below that the pointer is not followed.
    wheel(page, 2000)
    assert settled_depth(page) < deep + 0.51 * RADIUS
    assert np.linalg.norm(settled_force(page) - first) < 0.1 * np.linalg.norm(first)
    slide_to(page, "strain-limit", 51)
    assert page.locator("#strain-limit-value").input_value() == "off"
    until(page, lambda s: not s["limited"] and s["strain"] > 0.13)
    assert page.locator("#strain-warning").is_visible() and notice.is_hidden()
    page.mouse.up()
    page.locator("#reset").click()
    until(page, lambda _: page.locator("#strain-limit-value").input_value() == "30 %")


@pytest.mark.slow
def test_friction_bounds_the_force_along_the_surface(page):
    """Pushed to the same place with and without it: without friction the force is along the normal, and so smaller."""
    x, y = page.evaluate("window.palpate.pickPoint()")
    forces = []
    for friction in (0, 1):
        slide_to(page, "friction", friction)
        assert page.locator("#friction-value").input_value() == f"{friction:.2f}"
        press(page, place=(x, y + 60))
        drag(page, (x, y + 60), (x + 40, y + 60), 20)
        forces.append(settled_force(page))
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0)
    normal = forces[0] / np.linalg.norm(forces[0])
    along = forces[1] - (forces[1] @ normal) * normal
    assert np.linalg.norm(along) > 0.1 * np.linalg.norm(forces[1])
    page.locator("#reset").click()
    until(page, lambda _: page.locator("#friction-value").input_value() == "0.30")


@pytest.mark.slow
def test_deformation_drawn_larger_is_marked(page):
    banner, legend = page.get_by_test_id("scale-banner"), page.get_by_test_id("legend-scale")
    assert banner.is_hidden() and legend.is_hidden()
    press(page)
    true, place = settled_force(page), state(page)["tools"][0]["position"]
    page.mouse.up()
    # Until the dent is gone, another place of the body is on top: five times as deep it is where the finger was.
    until(page, lambda s: s["contacts"] == 0 and s["strain"] < 1e-6)
    slide_to(page, "shown-scale", 5)
    assert banner.inner_text() == "Deformation drawn 5x" and "5x" in legend.inner_text()
    press(page)
    # Drawn is five times as much, felt is not.
    assert np.linalg.norm(settled_force(page)) == pytest.approx(np.linalg.norm(true), rel=0.1)
    assert state(page)["tools"][0]["position"] == pytest.approx(place, abs=1e-4)
    page.mouse.up()
    slide_to(page, "shown-scale", 1)
    assert banner.is_hidden() and legend.is_hidden()


@pytest.mark.slow
def test_fields_have_a_legend(page):
    press(page)
    for name, title, unit in (
        ("von_mises", "Von Mises stress", "Pa"),
        ("principal_stress", "First principal stress", "Pa"),
        ("strain", "Largest principal strain", "%"),
        ("displacement", "Displacement", "mm"),
    ):
        field = choose_field(page, name)
        legend = page.locator("#legend-field").inner_text()
        assert title in legend and unit in legend
        assert field["signed"] == ("\u2212" in legend)
    page.mouse.up()


def test_a_grab_pulls(page):
    x, y = page.evaluate("window.palpate.pickPoint()")
    page.keyboard.down("Control")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 16):
        page.mouse.move(x, y - 3 * step)
    until(page, lambda s: s["contacts"] == 1 and s["force"][2] < -0.02)
    page.mouse.up()
    page.keyboard.up("Control")
    until(page, lambda s: s["force"] == [0, 0, 0])


@pytest.mark.slow
def test_stiffness_scales_the_force_at_once(page):
    slider = page.get_by_test_id("stiffness")
    press(page)
    soft = settled_force(page)
    value = page.locator("#stiffness-value").input_value()
    modulus = float(value.split()[0])
    slider.evaluate("e => { e.value = Number(e.value) + 0.15; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    until(page, lambda s: abs(s["forceMagnitude"] / np.linalg.norm(soft) - 1) > 0.2)
    stiff = settled_force(page)
    now = float(page.locator("#stiffness-value").input_value().split()[0])
    assert np.linalg.norm(stiff) / np.linalg.norm(soft) == pytest.approx(now / modulus, rel=0.03)
    page.mouse.up()
    page.locator("#reset").click()
    until(page, lambda s: s["force"] == [0, 0, 0])


@pytest.mark.slow
def test_cut_away_and_another_model(page):
    choose_field(page, "von_mises")
    page.locator("#show-cutaway").click()
    drawn(page)
    press(page)
    page.mouse.up()
    page.locator("#show-cutaway").click()
    page.get_by_test_id("model-select").select_option("beam")
    # The beam is cut along its middle, where its highest points are; the field is kept.
    until(page, lambda s: s["scene"] == "beam" and s["field"] and s["field"]["name"] == "von_mises")
    page.locator("#show-cutaway").click()
    press(page)
    page.mouse.up()
    page.locator("#show-cutaway").click()
    page.get_by_test_id("model-select").select_option("liver")
    until(page, lambda s: s["scene"] == "liver")


@pytest.mark.slow
def test_long_work_has_a_cancel_button(chromium, tmp_path):
    """With an empty cache the next body has to be solved first."""
    started = Program(tmp_path, "beam", "--paper")
    with opened(chromium, started) as page:
        page.get_by_test_id("model-select").select_option("doll")
        page.get_by_test_id("status-cancel").click()
        page.get_by_text("cancelled").wait_for()
        page.get_by_test_id("status").wait_for(state="hidden")
        assert page.get_by_test_id("model-select").input_value() == "beam" and state(page)["scene"] == "beam"
        press(page)
        page.mouse.up()
    assert started.stop() == 0


@pytest.mark.slow
def test_leaving_the_page_lets_go(chromium, program, page):
    watcher = chromium.new_context(device_scale_factor=0.25).new_page()
    watcher.goto(program.address)
    until(watcher, lambda s: s["frames"] > 3 and s["role"] == "watch")
    assert watcher.locator("#watching").is_visible()
    press(page)
    until(watcher, lambda s: s["contacts"] == 1)
    page.goto("about:blank")
    until(watcher, lambda s: s["contacts"] == 0 and s["role"] == "control")
    watcher.context.close()


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_nothing_is_cut_off(chromium, program, size):
    context = chromium.new_context(viewport={"width": size[0], "height": size[1]}, device_scale_factor=0.25)
    context.add_init_script(MORE_OPEN)
    page = context.new_page()
    page.goto(program.address)
    until(page, lambda s: s["frames"] > 3)
    width, height = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert (width, height) == size
    for name in ("force-value", "model-select", "stiffness", "friction", "connection"):
        box = page.get_by_test_id(name).bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= size[0]
    press(page)
    page.mouse.up()
    context.close()


def test_an_address_without_the_token_is_explained(chromium, program):
    context = chromium.new_context(device_scale_factor=0.25)
    page = context.new_page()
    page.goto(program.address.partition("#")[0] + "#token=wrong")
    page.get_by_text("no valid token").wait_for()
    assert not state(page)["connected"]
    context.close()


def test_a_page_from_another_origin_cannot_connect(chromium, program, tmp_path):
    """Even one that somehow knows the token."""
    (tmp_path / "index.html").write_text("<title>elsewhere</title>")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments):
            super().__init__(*arguments, directory=str(tmp_path))

        def log_message(self, *arguments):
            pass

    elsewhere = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    threading.Thread(target=elsewhere.serve_forever, daemon=True).start()
    context = chromium.new_context()
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{elsewhere.server_port}/")
    socket = program.address.partition("/#")[0].replace("http", "ws") + "/socket"
    outcome = page.evaluate(
        """address => new Promise(resolve => {
            const socket = new WebSocket(address);
            socket.onopen = () => resolve("opened");
            socket.onerror = () => resolve("refused");
        })""",
        socket,
    )
    assert outcome == "refused"
    context.close()
    elsewhere.shutdown()
    elsewhere.server_close()


@pytest.mark.slow
def test_a_program_that_ends_is_noticed(chromium, cache):
    program = Program(cache, "liver", "--paper")
    context = chromium.new_context(device_scale_factor=0.25)
    page = context.new_page()
    page.goto(program.address)
    until(page, lambda s: s["frames"] > 3)
    assert program.stop() == 0
    page.get_by_text("Connection lost").wait_for()
    context.close()
