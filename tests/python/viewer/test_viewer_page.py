"""The viewer's page in a real Chromium, driven by Playwright, against the program that a user starts."""

from __future__ import annotations

import http.server
import threading
import time

import numpy as np
import pytest
from browser import MARKS, Program, opened, press, settled_force, state, until

pytestmark = MARKS


@pytest.fixture(scope="module")
def program(cache):
    started = Program(cache, "liver", "--paper")
    yield started
    assert started.stop() == 0


@pytest.fixture(scope="module")
def struck(cache):
    """The paper's beam in motion, struck by itself when a page opens."""
    started = Program(cache, "beam", "--paper", "--impulse")
    yield started
    assert started.stop() == 0


@pytest.fixture
def page(chromium, program):
    with opened(chromium, program) as page:
        yield page


@pytest.fixture
def moving_page(chromium, struck):
    with opened(chromium, struck) as page:
        yield page


def displayed(page) -> float:
    return float(page.get_by_test_id("force-value").inner_text().replace("\u2212", "-"))


def test_a_press_is_felt_shown_and_released(page, capsys):
    assert displayed(page) == 0.0
    before, started = state(page), time.monotonic()
    pressed = press(page, steps=60)
    moved, took = state(page), time.monotonic() - started
    # Pressed from above: the device is pushed up, the body's force on it has the sign of the outward normal.
    assert pressed["force"][2] > 0
    force = settled_force(page)
    assert displayed(page) == pytest.approx(np.linalg.norm(force), rel=0.02)
    page.mouse.up()
    until(page, lambda s: s["contacts"] == 0 and s["force"] == [0, 0, 0])
    time.sleep(0.3)
    assert displayed(page) == 0.0
    frames, pointer = (moved[k] - before[k] for k in ("frames", "pointerEvents"))
    with capsys.disabled():
        print(f"\n  {frames / took:.0f} frames applied/s, {pointer / took:.0f} pointer events/s (software GL)")


def test_the_wheel_deepens_a_press(page):
    press(page, 4)
    first = settled_force(page)
    for _ in range(5):
        page.mouse.wheel(0, 100)
        time.sleep(0.05)
    deeper = settled_force(page)
    assert np.linalg.norm(first) != pytest.approx(np.linalg.norm(deeper), rel=0.01)
    page.mouse.up()


def choose_field(page, name: str) -> dict:
    page.get_by_test_id("field-select").select_option(name)
    return until(page, lambda s: s["field"] and s["field"]["name"] == name)["field"]


def test_a_press_is_limited_to_ten_per_cent(page):
    notice, strain = page.get_by_test_id("limit-notice"), page.get_by_test_id("strain-value")
    assert notice.is_hidden()
    x, y = page.evaluate("window.palpate.pickPoint()")
    press(page, 100)
    until(page, lambda s: s["limited"] and s["strain"] > 0.099)
    first = settled_force(page)
    assert notice.inner_text() == "Limited to 10 % strain"
    assert 9.5 <= float(strain.inner_text()) <= 10.5
    wanted = state(page)["depth"]
    page.mouse.move(x, y + 160)
    until(page, lambda s: s["depth"] > wanted + 0.005)
    assert np.linalg.norm(settled_force(page) - first) < 0.02 * np.linalg.norm(first)
    assert state(page)["strain"] <= 0.105
    page.mouse.up()
    until(page, lambda s: not s["limited"] and s["contacts"] == 0)
    assert notice.is_hidden()


def test_fields_have_a_legend(page):
    press(page, 8)
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
    page.keyboard.down("Shift")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 16):
        page.mouse.move(x, y - 3 * step)
    until(page, lambda s: s["contacts"] == 1 and s["force"][2] < -0.02)
    page.mouse.up()
    page.keyboard.up("Shift")
    until(page, lambda s: s["force"] == [0, 0, 0])


def test_stiffness_scales_the_force_at_once(page):
    slider = page.get_by_test_id("stiffness")
    press(page, 20)
    soft = settled_force(page)
    value = page.locator("#stiffness-value").inner_text()
    modulus = float(value.split()[0])
    slider.evaluate("e => { e.value = Number(e.value) + 0.15; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    until(page, lambda s: abs(s["forceMagnitude"] / np.linalg.norm(soft) - 1) > 0.2)
    stiff = settled_force(page)
    now = float(page.locator("#stiffness-value").inner_text().split()[0])
    assert np.linalg.norm(stiff) / np.linalg.norm(soft) == pytest.approx(now / modulus, rel=0.03)
    page.mouse.up()
    page.locator("#reset").click()
    until(page, lambda s: s["force"] == [0, 0, 0])


def test_cut_away_and_another_model(page):
    choose_field(page, "von_mises")
    page.locator("#show-cutaway").click()
    time.sleep(0.5)
    press(page, 20)
    page.mouse.up()
    page.locator("#show-cutaway").click()
    page.get_by_test_id("model-select").select_option("beam")
    # The beam is cut along its middle, where its highest points are; the field is kept.
    until(page, lambda s: s["scene"] == "beam" and s["field"] and s["field"]["name"] == "von_mises", 60)
    page.locator("#show-cutaway").click()
    press(page, 10)
    page.mouse.up()
    page.locator("#show-cutaway").click()
    page.get_by_test_id("model-select").select_option("liver")
    until(page, lambda s: s["scene"] == "liver", 60)


def test_a_screenshot_is_a_picture(page, tmp_path):
    from PIL import Image

    with page.expect_download() as download:
        page.locator("#screenshot").click()
    download.value.save_as(tmp_path / "shot.png")
    pixels = np.asarray(Image.open(tmp_path / "shot.png").convert("RGB"), dtype=float)
    assert pixels.std() > 5


def swings(page, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Height of the marked node, m, and total energy, J, as often as the page can be asked."""
    end, seen = time.monotonic() + seconds, []
    while time.monotonic() < end:
        motion = state(page)["motion"]
        seen.append((motion["bodyTime"], motion["displacement"][2], motion["total"]))
    rows = np.unique(np.array(seen), axis=0)
    return rows[:, 1], rows[:, 2]


def test_the_impulse_is_given_and_repeated(moving_page):
    page = moving_page
    # Slowed down so that an eye follows 30 Hz.
    assert page.locator("#speed-10").get_attribute("aria-pressed") == "true"
    first = until(page, lambda s: s["motion"]["struck_at"] is not None and s["motion"]["total"] > 1e-4)["motion"]
    height, energy = swings(page, 1.5)
    crossings = np.count_nonzero(np.diff(np.sign(height)))
    assert crossings >= 3 and np.abs(height).max() > 1e-4
    assert 0 < energy[-1] < 0.7 * energy.max()
    # 10 N for a millisecond: what the node's neighbourhood takes up by it.
    work = state(page)["motion"]["work"]
    page.get_by_test_id("repeat").click()
    again = until(page, lambda s: s["motion"]["struck_at"] > first["struck_at"] and s["motion"]["work"] > 1.5 * work)
    assert again["motion"]["watched"] == first["watched"]
    page.get_by_test_id("speed-4").click()
    until(page, lambda s: page.locator("#speed-4").get_attribute("aria-pressed") == "true")


def test_a_click_strikes_in_motion(moving_page):
    page = moving_page
    until(page, lambda s: s["motion"]["struck_at"] is not None)
    time.sleep(1.0)  # the page gives the scene's own strike when it opens
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


def test_modes_swing_one_by_one(moving_page):
    page = moving_page
    assert page.get_by_test_id("stiffness").is_disabled()
    assert "fixed" in page.locator("#stiffness-value").inner_text()
    page.get_by_test_id("tab-modes").click()
    third = page.get_by_test_id("mode-list").locator("button").nth(2)
    third.click()
    mode = until(page, lambda s: s["motion"]["mode"] is not None and s["strain"] > 0.01)["motion"]["mode"]
    assert mode["number"] == 3
    frequency = f"{mode['frequency']:.3g} Hz"
    assert frequency in third.inner_text()
    banner = page.get_by_test_id("mode-banner")
    assert f"Mode 3: {frequency}, shown slowed" in banner.inner_text()
    # Once a second, here; the body itself rests.
    strains = []
    for _ in range(40):
        strains.append(state(page)["strain"])
        time.sleep(0.025)
    assert max(strains) > 2 * min(strains) and max(strains) <= 0.1 + 1e-6
    press(page, 10)
    page.mouse.up()
    until(page, lambda s: s["motion"]["mode"] is None)
    assert not banner.is_visible()


def test_long_work_has_a_cancel_button(chromium, tmp_path):
    """With an empty cache the next body has to be solved first."""
    started = Program(tmp_path, "beam", "--paper")
    with opened(chromium, started) as page:
        page.get_by_test_id("model-select").select_option("doll")
        page.get_by_test_id("status-cancel").click(timeout=20_000)
        page.get_by_text("cancelled").wait_for(timeout=20_000)
        page.get_by_test_id("status").wait_for(state="hidden", timeout=20_000)
        assert page.get_by_test_id("model-select").input_value() == "beam" and state(page)["scene"] == "beam"
        press(page, 10)
        page.mouse.up()
    assert started.stop() == 0


def test_leaving_the_page_lets_go(chromium, program, page):
    watcher = chromium.new_context().new_page()
    watcher.goto(program.address)
    until(watcher, lambda s: s["frames"] > 3 and s["role"] == "watch")
    assert watcher.locator("#watching").is_visible()
    press(page)
    until(watcher, lambda s: s["contacts"] == 1)
    page.goto("about:blank")
    until(watcher, lambda s: s["contacts"] == 0 and s["role"] == "control")
    watcher.context.close()


@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_nothing_is_cut_off(chromium, program, size):
    context = chromium.new_context(viewport={"width": size[0], "height": size[1]})
    page = context.new_page()
    page.goto(program.address)
    until(page, lambda s: s["frames"] > 3)
    width, height = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert (width, height) == size
    for name in ("force-value", "model-select", "stiffness", "radius", "connection"):
        box = page.get_by_test_id(name).bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= size[0]
    press(page)
    page.mouse.up()
    context.close()


def test_an_address_without_the_token_is_explained(chromium, program):
    context = chromium.new_context()
    page = context.new_page()
    page.goto(program.address.partition("#")[0] + "#token=wrong")
    page.get_by_text("no valid token").wait_for(timeout=10_000)
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


def test_a_program_that_ends_is_noticed(chromium, cache):
    program = Program(cache, "liver", "--paper")
    context = chromium.new_context()
    page = context.new_page()
    page.goto(program.address)
    until(page, lambda s: s["frames"] > 3)
    assert program.stop() == 0
    page.get_by_text("Connection lost").wait_for(timeout=10_000)
    context.close()
