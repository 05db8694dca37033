"""The page's controls: numbers of sliders, reset, keys and help, and all of it on a phone with fingers."""

from __future__ import annotations

import time

import numpy as np
import pytest
from browser import MARKS, MORE_OPEN, Program, drawn, opened, press, settled_force, state, until

import palpate

pytestmark = MARKS

# With few pixels, as `opened` has them.
PHONE = {
    "viewport": {"width": 390, "height": 844},
    "device_scale_factor": 0.25,
    "has_touch": True,
    "is_mobile": True,
}


@pytest.fixture
def phone(chromium, program):
    context = chromium.new_context(**PHONE)
    context.add_init_script(MORE_OPEN)
    page = context.new_page()
    page.goto(program.address)
    until(page, lambda s: s["frames"] > 3)
    yield page
    context.close()


def fill(page, name: str, text: str) -> None:
    number = page.get_by_test_id(f"{name}-value")
    number.fill(text)
    number.press("Enter")


def shows(page, name: str, text: str) -> None:
    until(page, lambda _: page.get_by_test_id(f"{name}-value").input_value() == text)


def slide(page, name: str, value: float) -> None:
    page.get_by_test_id(name).evaluate(
        "(e, value) => { e.value = value; e.dispatchEvent(new Event('input', {bubbles: true})); }", value
    )


@pytest.mark.slow
def test_a_number_is_typed_and_a_double_click_brings_the_default(page):
    # With friction the force depends on how the tool came to its place, which a busy machine changes by 2 %.
    fill(page, "friction", "0")
    shows(page, "friction", "0.00")
    press(page)
    soft = np.linalg.norm(settled_force(page))
    page.mouse.up()
    # What is highest, and so pressed, is another place while the dent is there.
    until(page, lambda s: s["contacts"] == 0 and s["strain"] < 1e-6)
    fill(page, "stiffness", "16")
    shows(page, "stiffness", "16.0 kPa")
    press(page)
    assert np.linalg.norm(settled_force(page)) == pytest.approx(2 * soft, rel=0.02)
    page.mouse.up()
    # Beyond the slider, in another unit.
    fill(page, "stiffness", "0,25 MPa")
    shows(page, "stiffness", "250 kPa")
    page.get_by_test_id("stiffness").dblclick()
    shows(page, "stiffness", "8.00 kPa")
    fill(page, "friction", "0.75")
    shows(page, "friction", "0.75")
    assert float(page.get_by_test_id("friction").input_value()) == 0.75
    fill(page, "strain-limit", "12%")
    shows(page, "strain-limit", "12 %")
    fill(page, "strain-limit", "off")
    shows(page, "strain-limit", "off")
    page.get_by_test_id("strain-limit").dblclick()
    shows(page, "strain-limit", "30 %")
    fill(page, "shown-scale", "4")
    assert page.get_by_test_id("scale-banner").inner_text() == "Deformation drawn 4x"
    page.get_by_test_id("shown-scale").dblclick()
    assert page.get_by_test_id("scale-banner").is_hidden()
    page.get_by_test_id("friction").dblclick()
    shows(page, "friction", "0.30")


def test_what_is_no_stiffness_is_told(page):
    for typed, why in {"soft": "is not a number", "12 mm": "is not a number", "-3": "must be positive"}.items():
        fill(page, "stiffness", typed)
        notice = page.locator("#notices").get_by_text(f"Material stiffness{':' if 'not' in why else ''}")
        notice.filter(has_text=why).filter(has_text=f"'{typed}'").wait_for()
        page.locator("#reset").click()
        shows(page, "stiffness", "8.00 kPa")


def test_escape_leaves_a_number_as_it_was(page):
    number = page.get_by_test_id("friction-value")
    number.fill("0.9")
    number.press("Escape")
    drawn(page)
    assert number.input_value() == "0.30"


def test_reset_puts_all_sliders_back_at_once(page):
    """Within the time in which a slider that was just moved does not listen to the server."""
    slide(page, "stiffness", 0.9)
    slide(page, "friction", 0.9)
    slide(page, "strain-limit", 10)
    slide(page, "shown-scale", 7)
    page.locator("#reset").click()
    for name, text in {
        "stiffness": "8.00 kPa",
        "friction": "0.30",
        "strain-limit": "30 %",
        "shown-scale": "1x",
    }.items():
        shows(page, name, text)
    time.sleep(0.6)
    drawn(page)
    # Nothing that was on its way has come after it.
    for name, text in {"stiffness": "8.00 kPa", "friction": "0.30", "strain-limit": "30 %"}.items():
        assert page.get_by_test_id(f"{name}-value").input_value() == text


def test_reset_puts_the_radius_of_a_patch_back(chromium, block_green, cache, tmp_path):
    scene = tmp_path / "patch.toml"
    scene.write_text(
        f'[body]\nstore = "{block_green.path}"\n[tool]\ncontact = "patch"\nradius = "6mm"\ncontact_radius = "5mm"\n'
    )
    started = Program(cache, str(scene), command="run")
    with opened(chromium, started) as page:
        shows(page, "radius", "5.0 mm")
        fill(page, "radius", "3")
        shows(page, "radius", "3.0 mm")
        page.locator("#reset").click()
        shows(page, "radius", "5.0 mm")
        fill(page, "radius", "0.2 cm")
        shows(page, "radius", "2.0 mm")
        page.get_by_test_id("radius").dblclick()
        shows(page, "radius", "5.0 mm")
    assert started.stop() == 0


def pressed(page, name: str) -> bool:
    return page.locator(f"#show-{name}").get_attribute("aria-pressed") == "true"


def test_keys_belong_to_lists_and_numbers_while_these_have_them(page):
    field = page.get_by_test_id("field-select")
    assert not pressed(page, "wireframe")
    field.focus()
    for key in ("w", "x", "r", "?"):
        page.keyboard.press(key)
    assert not pressed(page, "wireframe") and not pressed(page, "cutaway") and page.get_by_test_id("help").is_hidden()
    number = page.get_by_test_id("friction-value")
    number.focus()
    page.keyboard.press("w")
    assert not pressed(page, "wireframe") and number.input_value() == "w"
    page.keyboard.press("Escape")
    # A list that a mouse has chosen from gives the keys back.
    field.click()
    field.evaluate("e => { e.value = 'strain'; e.dispatchEvent(new Event('change', {bubbles: true})); }")
    page.keyboard.press("w")
    assert pressed(page, "wireframe")
    page.keyboard.press("w")


def test_help_is_opened_and_ended_by_a_question_mark(page):
    help_ = page.get_by_test_id("help")
    page.keyboard.press("?")
    assert help_.is_visible()
    text = help_.inner_text()
    for word in ("Drag", "Wheel", "Shift drag", "Two, anywhere", "cut open", "Double click"):
        assert word in text, word
    # Below it keys do nothing.
    page.keyboard.press("w")
    assert not pressed(page, "wireframe")
    page.keyboard.press("?")
    assert help_.is_hidden()
    page.get_by_test_id("help-open").click()
    assert help_.is_visible()
    page.keyboard.press("Escape")
    assert help_.is_hidden()


def test_every_key_that_the_help_names_does_something(page):
    keys = [key.inner_text() for key in page.locator("#help-keys kbd").all()] or page.evaluate(
        "[...document.querySelectorAll('#help-keys kbd')].map(e => e.textContent)"
    )
    assert {"r", "n", "Esc", "g", "f", "c", "w", "s", "x", "p", "v", "?"} <= set(keys)
    for key, name in {"c": "colors", "w": "wireframe", "s": "supports", "x": "cutaway", "p": "plots"}.items():
        before = pressed(page, name)
        page.keyboard.press(key)
        assert pressed(page, name) is not before
        page.keyboard.press(key)
    before = page.get_by_test_id("field-select").input_value()
    page.keyboard.press("f")
    assert page.get_by_test_id("field-select").input_value() != before


def reachable(page, selector: str) -> bool:
    """Whether an element can be scrolled to where a finger meets it, and it alone."""
    element = page.locator(selector)
    element.evaluate("e => e.scrollIntoView({block: 'center'})")
    return element.evaluate(
        """e => { const b = e.getBoundingClientRect(), x = b.left + b.width / 2, y = b.top + b.height / 2;
                  const met = document.elementFromPoint(x, y);
                  return met !== null && (e === met || e.contains(met)); }"""
    )


BUTTONS = ("#show-cutaway", "#show-plots", "#grab", "#pin", "#reset", "#reset-view", "#screenshot", "#tab-loop")


@pytest.mark.quick(2)
@pytest.mark.parametrize("sheet", ["half", "tall"])
def test_all_is_within_reach_on_a_phone(phone, sheet):
    if sheet == "tall":
        phone.get_by_test_id("sheet-tall").tap()
    for selector in (*BUTTONS, "#plot-force", "#plot-press", "#stat-ticks", "#theme", "#help-open", "#legend-lock"):
        if sheet == "tall" and selector == "#legend-lock":
            continue
        assert reachable(phone, selector), selector
    # Two plots at once are seen in the tall sheet.
    if sheet == "tall":
        phone.locator("#plot-press").evaluate("e => e.scrollIntoView({block: 'end'})")
        tops = [phone.locator(name).bounding_box() for name in ("#panel-body", "#plot-force", "#plot-press")]
        assert tops[1]["y"] > tops[0]["y"] and tops[2]["y"] + tops[2]["height"] <= 844
    phone.locator("#tab-loop").tap()
    assert phone.locator("#plot-compute").is_visible()
    phone.get_by_test_id("sheet-toggle").tap()
    assert phone.locator("#panel-body").is_hidden()
    assert phone.get_by_test_id("legend-max").is_visible()
    width, height = phone.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
    assert (width, height) == (390, 844)


def test_the_body_stays_in_sight_when_the_sheet_goes(phone):
    nodes = palpate.models.load("liver", paper=True).nodes
    ends = nodes[np.concatenate([nodes.argmin(axis=0), nodes.argmax(axis=0)])]

    def seen() -> np.ndarray:
        drawn(phone)
        return np.array([phone.evaluate("p => window.palpate.project(p)", end.tolist()) for end in ends])

    first = seen()
    phone.get_by_test_id("sheet-toggle").tap()
    alone = seen()
    canvas = phone.locator("#canvas").bounding_box()
    assert canvas["height"] > 700
    assert (alone > [0, 0]).all() and (alone < [canvas["width"], canvas["height"]]).all()
    # It uses the room that it has.
    assert np.ptp(alone[:, 0]) > 0.6 * canvas["width"] and np.ptp(alone[:, 0]) > np.ptp(first[:, 0])
    phone.get_by_test_id("sheet-toggle").tap()
    assert np.allclose(seen(), first, atol=2)
    phone.get_by_test_id("sheet-tall").tap()
    assert np.allclose(seen(), first, atol=2)


class Fingers:
    """Touches of several fingers, by the browser's own protocol."""

    def __init__(self, page):
        self._session = page.context.new_cdp_session(page)
        self.places: list[tuple[float, float]] = []

    def _send(self, kind: str) -> None:
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(self.places)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def down(self, *places: tuple[float, float]) -> None:
        """One after the other, as hands do."""
        for place in places:
            self.places.append(place)
            self._send("touchStart")
            time.sleep(0.05)

    def move(self, moves: list[tuple[float, float]], steps: int = 12) -> None:
        start = list(self.places)
        for step in range(1, steps + 1):
            share = step / steps
            self.places = [(x + share * dx, y + share * dy) for (x, y), (dx, dy) in zip(start, moves, strict=True)]
            self._send("touchMove")
            time.sleep(0.02)

    def up(self) -> None:
        self.places = []
        self._send("touchEnd")


def view(page) -> dict[str, np.ndarray]:
    return {name: np.array(value) for name, value in page.evaluate("window.palpate.view()").items()}


@pytest.mark.slow
def test_two_fingers_turn_and_zoom_and_three_move_where_the_body_fills_the_screen(phone):
    phone.locator("#hint-close").tap()
    box = phone.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + 0.75 * box["height"]
    fingers, before = Fingers(phone), view(phone)
    fingers.down((x - 30, y), (x + 30, y))
    fingers.move([(-90, 0), (90, 0)])
    fingers.up()
    drawn(phone)
    # Four times as far apart.
    close = view(phone)
    assert close["distance"] == pytest.approx(before["distance"] / 4, rel=0.3)
    assert close["towards"] @ before["towards"] > 0.999
    # Wherever a finger comes down now it presses; the corners are under the readouts.
    for place in ((x, y), (x - 120, y), (x + 120, y + 40)):
        fingers.down(place)
        until(phone, lambda s: s["contacts"] == 1)
        assert view(phone)["towards"] @ close["towards"] > 1 - 1e-9
        fingers.up()
        until(phone, lambda s: s["contacts"] == 0)
    # A second finger lets go and turns.
    fingers.down((x, y))
    until(phone, lambda s: s["contacts"] == 1)
    fingers.down((x + 60, y))
    until(phone, lambda s: s["contacts"] == 0)
    fingers.move([(80, 30), (80, 30)])
    fingers.up()
    drawn(phone)
    turned = view(phone)
    assert turned["towards"] @ close["towards"] < 0.95
    assert turned["distance"] == pytest.approx(close["distance"], rel=0.05)
    assert np.allclose(turned["target"], close["target"], atol=1e-6) and state(phone)["contacts"] == 0
    seen = np.array(phone.evaluate("p => window.palpate.project(p)", turned["target"].tolist()))
    fingers.down((x - 40, y), (x, y), (x + 40, y))
    fingers.move([(30, -40)] * 3)
    fingers.up()
    drawn(phone)
    moved = view(phone)
    assert moved["towards"] @ turned["towards"] > 1 - 1e-6
    now = np.array(phone.evaluate("p => window.palpate.project(p)", turned["target"].tolist()))
    assert now - seen == pytest.approx([30, -40], abs=4)
    assert state(phone)["contacts"] == 0
