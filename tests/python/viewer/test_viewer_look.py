"""What the page shows beside the body: legend, regions, the face of a cut, scale, themes, what a screenshot carries."""

from __future__ import annotations

import io
import re
import time
from pathlib import Path

import numpy as np
import pytest
from browser import MARKS, MORE_OPEN, Program, drawn, eventually, opened, press, state, until, wheel
from PIL import Image

pytestmark = MARKS
# Colours of single pixels are looked at.
SHARPNESS = 1.0

# Ends of the colours of a field that is never negative: matplotlib's viridis from a fifth on.
FIRST, LAST = (65, 68, 135), (253, 231, 37)
ORANGE, SKY = (230, 159, 0), (86, 180, 233)
LAYERS = """
[body]
mesh = "{block}"
unit = "mm"
max_element_size = "25mm"

[supports]
fixed = "z < min + 1mm"

[[region]]
shape = "half-space"
point = ["40mm", 0, 0]
normal = [-1, 0, 0]
youngs_modulus = "40kPa"
"""


@pytest.fixture(scope="module")
def layered(cache, tmp_path_factory):
    """A block whose right half is stiffer."""
    scene = tmp_path_factory.mktemp("scene") / "layers.toml"
    scene.write_text(LAYERS.format(block=Path(__file__).parents[3] / "examples" / "block.obj"))
    started = Program(cache, str(scene), command="run")
    yield started
    assert started.stop() == 0


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=float)


def near(picture: np.ndarray, color, within: float = 12) -> int:
    """How many pixels have a colour."""
    return int((np.abs(picture - np.array(color)).max(axis=2) < within).sum())


def saved(page, tmp_path) -> np.ndarray:
    with page.expect_download() as download:
        page.evaluate("document.getElementById('screenshot').click()")
    download.value.save_as(tmp_path / "shot.png")
    return pixels((tmp_path / "shot.png").read_bytes())


def part(picture: np.ndarray, page, selector: str) -> np.ndarray:
    """Part of a screenshot where an element of the page stands."""
    box, canvas = (page.locator(name).bounding_box() for name in (selector, "#canvas"))
    left, top = round(box["x"] - canvas["x"]), round(box["y"] - canvas["y"])
    return picture[top : top + round(box["height"]), left : left + round(box["width"])]


def hue(color: np.ndarray) -> np.ndarray:
    """Shares of the channels: what light leaves alone."""
    return color / color.sum(axis=-1, keepdims=True)


@pytest.mark.slow
def test_a_screenshot_carries_force_legend_and_scale(page, tmp_path):
    press(page, 2)
    shot = saved(page, tmp_path)
    canvas = page.locator("#canvas").bounding_box()
    assert shot.shape[:2] == (round(canvas["height"]), round(canvas["width"]))
    legend = part(shot, page, "#legend-bar")
    middle = legend[len(legend) // 2]
    assert np.abs(middle[2] - FIRST).max() < 12 and np.abs(middle[-3] - LAST).max() < 12
    # What is written stands out as on the page itself.
    for selector in ("#force-value", "#legend-name", "#legend-max", "#legend-size", "#depth-value", "#scale"):
        on_page = pixels(page.locator(selector).screenshot())
        spreads = [np.ptp(picture.reshape(-1, 3), axis=0).max() for picture in (part(shot, page, selector), on_page)]
        assert spreads[0] > 100 and spreads[0] == pytest.approx(spreads[1], rel=0.3), selector
    # The bar is as long as it says.
    bar = part(shot, page, "#scale")[-8]
    dark = np.flatnonzero(np.abs(bar - bar[-1]).max(axis=1) > 60)
    length = float(page.get_by_test_id("scale").get_attribute("data-pixels"))
    assert np.ptp(dark) == pytest.approx(length, abs=2.5)
    page.mouse.up()


@pytest.mark.slow
def test_a_screenshot_has_all_pixels_of_a_large_window(chromium, program, tmp_path):
    """Frames of a window of more than four million pixels are drawn with fewer; a picture that is kept is not."""
    size = (1400, 1100)
    with opened(chromium, program, size=size, sharpness=2.0) as page:
        drawn_pixels = page.evaluate("document.getElementById('canvas').width")
        shot = saved(page, tmp_path)
        width = page.locator("#canvas").bounding_box()["width"]
        assert drawn_pixels < 2 * width - 10
        assert shot.shape[1] == pytest.approx(2 * width, abs=2)
        # Frames are drawn with fewer pixels again.
        assert page.evaluate("document.getElementById('canvas').width") == drawn_pixels


@pytest.mark.slow
def test_the_scale_bar_is_true_and_follows_the_zoom(chromium, program):
    """The bar is measured in pixels of the layout: few of the screen are enough."""
    with opened(chromium, program) as page:
        the_scale_bar_is_true_and_follows_the_zoom(page)


def the_scale_bar_is_true_and_follows_the_zoom(page):
    def told():
        bar = page.get_by_test_id("scale")
        metres, length = (float(bar.get_attribute(f"data-{name}")) for name in ("metres", "pixels"))
        assert 40 < length <= 104.5
        return metres, length, bar.get_attribute("aria-label")

    metres, length, label = told()
    assert f"{1e3 * metres:g} mm" in label
    # Along the picture through what the view turns about: its middle is a point of the free part of the picture.
    sides = page.evaluate(
        """length => { const [x, y] = window.palpate.project([0, 0, 0]);
                       const [a, b] = window.palpate.project([length, 0, 0]); return Math.hypot(a - x, b - y); }""",
        metres,
    )
    # The camera looks down on x at an angle; what is nearer is larger.
    assert 0.6 * length < sides < 1.3 * length
    page.mouse.move(700, 60)
    for _ in range(12):
        wheel(page, -200)
        drawn(page, 1)
    closer, _, _ = eventually(page, told, lambda seen: seen[0] < metres)
    assert closer < metres
    page.keyboard.press("v")


@pytest.mark.slow
def test_a_range_is_locked_where_it_is_or_where_it_is_typed(page):
    field = page.get_by_test_id("field-select")
    field.select_option("displacement")
    press(page, 2)
    # By the mouse it could not be clicked, which presses.
    page.get_by_test_id("legend-lock").evaluate("e => e.click()")
    # It ends at a round number, and is not below what is seen.
    locked = until(page, lambda s: s["field"]["max"] == float(f"{s['field']['max']:.2g}"))["field"]["max"]
    until(page, lambda s: locked >= s["field"]["largest"] > 1)
    assert page.get_by_test_id("legend-lock").get_attribute("aria-pressed") == "true"
    page.mouse.up()
    # At rest the range would come down to half a per cent of the body within some seconds.
    until(page, lambda s: s["contacts"] == 0 and s["field"]["largest"] < 1e-3)
    time.sleep(2)
    assert state(page)["field"]["max"] == locked
    assert "largest now 0.00" in page.get_by_test_id("legend-largest").inner_text()
    number = page.get_by_test_id("legend-max")
    assert float(number.input_value()) == pytest.approx(locked, rel=0.01)
    number.fill("1,5")
    number.press("Enter")
    until(page, lambda s: s["field"]["max"] == 1.5)
    assert page.locator("#legend-middle").inner_text() == "0.75"
    # Each field has its own.
    field.select_option("von_mises")
    until(page, lambda s: s["field"]["name"] == "von_mises" and s["field"]["max"] != 1.5)
    number.fill("2 kPa")
    number.press("Enter")
    until(page, lambda s: s["field"]["max"] == 2000)
    assert number.input_value() == "2.00" and page.locator("#legend-unit").inner_text() == "kPa"
    number.fill("much")
    number.press("Enter")
    page.get_by_text("'much' is not a positive number").wait_for()
    assert state(page)["field"]["max"] == 2000
    field.select_option("displacement")
    until(page, lambda s: s["field"]["max"] == 1.5)
    page.get_by_test_id("legend-lock").click()
    until(page, lambda s: s["field"]["max"] != 1.5)


def body_hues(page, box: tuple[int, int, int, int]) -> np.ndarray:
    left, top, right, bottom = box
    clip = {"x": left, "y": top, "width": right - left, "height": bottom - top}
    return hue(pixels(page.screenshot(clip=clip)))


@pytest.mark.slow
def test_a_body_at_rest_has_the_colour_of_zero_and_not_its_own(page):
    """The liver is red; viridis begins with blue."""
    page.get_by_test_id("field-select").select_option("displacement")
    drawn(page)
    x, y = (round(k) for k in page.evaluate("window.palpate.pickPoint()"))
    place = (x - 8, y + 30, x + 8, y + 46)

    def red_and_blue() -> tuple[float, float]:
        red, _, blue = body_hues(page, place).mean(axis=(0, 1))
        return red, blue

    red, blue = eventually(page, red_and_blue, lambda seen: seen[1] > 1.2 * seen[0])
    assert blue > 1.2 * red
    page.keyboard.press("c")
    red, blue = eventually(page, red_and_blue, lambda seen: seen[0] > 1.5 * seen[1])
    assert red > 1.5 * blue
    page.keyboard.press("c")


@pytest.mark.slow
def test_regions_and_materials_have_colours_and_names(chromium, layered):
    with opened(chromium, layered, sharpness=SHARPNESS) as page:
        field, groups = page.get_by_test_id("field-select"), page.get_by_test_id("legend-groups")
        assert groups.is_hidden()
        field.select_option(label="Region")
        assert groups.inner_text().split("\n\n") == ["Rest of the body", "Half-space"]
        field.select_option(label="Material")
        assert re.findall(r"[\d.]+ kPa", groups.inner_text()) == ["10.0 kPa", "40.0 kPa"]
        assert page.locator("#legend-field").is_hidden()
        for cut in (False, True):
            if cut:
                page.keyboard.press("x")
            drawn(page)
            # On the top, or on the face of the cut; well beside the border, which goes along the elements.
            depth, height = (0.025, 0.02) if cut else (0.02, 0.05)
            places = [
                page.evaluate("p => window.palpate.project(p)", [x, depth, height]) for x in (0.01, 0.02, 0.06, 0.07)
            ]
            left, right = hue(np.array(ORANGE, float)), hue(np.array(SKY, float))

            def misplaced(places=places, left=left, right=right) -> list[int]:
                """Which places do not have the colour of their half."""
                shades = [body_hues(page, (x - 2, y - 2, x + 2, y + 2)).mean(axis=(0, 1)) for x, y in np.round(places)]
                halves = ((left, right), (left, right), (right, left), (right, left))
                off = [
                    [np.abs(shade - color).max() for color in half] for shade, half in zip(shades, halves, strict=True)
                ]
                return [place for place, (own, other) in enumerate(off) if own >= 0.5 * other]

            assert eventually(page, misplaced, lambda seen: seen == []) == [], cut
        field.select_option("displacement")
        assert groups.is_hidden() and page.locator("#legend-field").is_visible()


@pytest.mark.slow
def test_a_cut_is_plane_and_closed(chromium, layered):
    """Cut across y the face is a rectangle, whose edges are straight to a pixel, whatever the elements are."""
    with opened(chromium, layered, sharpness=SHARPNESS) as page:
        page.keyboard.press("x")
        page.locator("#cut-y").click()
        page.get_by_test_id("field-select").select_option(label="Region")
        number = page.get_by_test_id("cut-share-value")
        number.fill("37")
        number.press("Enter")
        page.locator("#hint-close").click()
        page.get_by_test_id("scale").evaluate("e => e.hidden = true")
        # Deformed with the body the face has come with frames that carry the inside.
        drawn(page, 5)
        y = 0.37 * 0.05
        corners = [(0.0, y, 0.0), (0.08, y, 0.0), (0.08, y, 0.05), (0.0, y, 0.05)]
        outline = np.array([page.evaluate("p => window.palpate.project(p)", list(corner)) for corner in corners])
        # The backdrop is grey.
        picture = pixels(page.screenshot())
        body = np.ptp(picture, axis=2) > 25
        # The front of the face: nothing of the body is below its lower edge, and all is body just above it.
        for part_along in np.linspace(0.05, 0.95, 19):
            x, edge = outline[0] + part_along * (outline[1] - outline[0])
            column = body[:, round(x)]
            assert column[round(edge) - 12 : round(edge) - 2].all(), part_along
            assert not column[round(edge) + 3 : round(edge) + 40].any(), part_along
        # No gap is open between the face and what is left of the skin: the light backdrop does not shine through.
        white = picture.min(axis=2)
        left, right = np.ceil(outline[3, 0]) + 8, np.floor(outline[2, 0]) - 8
        for x in np.arange(left, right).astype(int):
            top = outline[3, 1] + (x - outline[3, 0]) / (outline[2, 0] - outline[3, 0]) * np.diff(outline[3:1:-1, 1])[0]
            row = round(top)
            beside = np.vstack([white[row + way : row + way + 3, x - 6 : x + 7] for way in (-7, 4)])
            assert white[row - 2 : row + 3, x].max() < beside.max() + 25, x
        # Pressed on the face nothing happens, on what is left of the skin it does.
        middle = outline.mean(axis=0)
        page.mouse.move(*middle)
        page.mouse.down()
        drawn(page)
        time.sleep(0.5)
        assert state(page)["depth"] is None and state(page)["contacts"] == 0
        page.mouse.up()
        press(page)
        page.mouse.up()


@pytest.mark.slow
def test_a_store_says_why_it_is_not_cut_open(chromium, block_green, cache):
    started = Program(cache, str(block_green.path), command="run")
    try:
        with opened(chromium, started, sharpness=SHARPNESS) as page:
            button = page.locator("#show-cutaway")
            assert button.get_attribute("aria-disabled") == "true"
            assert "surface" in button.get_attribute("title")
            page.keyboard.press("x")
            page.get_by_text("Only the surface of this body is known").wait_for()
            assert button.get_attribute("aria-pressed") == "false" and page.locator("#cut").is_hidden()
            press(page)
            page.mouse.up()
    finally:
        assert started.stop() == 0


@pytest.mark.slow
@pytest.mark.parametrize("system", ["dark", "light"])
def test_the_theme_is_that_of_the_system_until_it_is_chosen(chromium, program, tmp_path, system):
    other = "light" if system == "dark" else "dark"
    context = chromium.new_context(viewport={"width": 1280, "height": 720}, color_scheme=system)
    context.add_init_script(MORE_OPEN)
    page = context.new_page()

    def brightness() -> dict[str, float]:
        seen = pixels(page.screenshot())
        shot = saved(page, tmp_path)
        return {"panel": seen[700, 1100].mean(), "backdrop": seen[300, 960].mean(), "saved": shot[300, 960].mean()}

    def is_light(name: str) -> None:
        def follows(seen: dict[str, float]) -> bool:
            return all(bool(value > 128) is (name == "light") for value in seen.values())

        seen = eventually(page, brightness, follows)
        assert follows(seen), (name, seen)

    page.goto(program.address)
    until(page, lambda s: s["frames"] > 3)
    is_light(system)
    page.emulate_media(color_scheme=other)
    is_light(other)
    page.emulate_media(color_scheme=system)
    context.add_init_script(MORE_OPEN)
    page.get_by_test_id("theme").click()
    is_light(other)
    page.reload()
    until(page, lambda s: s["frames"] > 3)
    is_light(other)
    # Text stands out from what it is written on.
    assert np.ptp(pixels(page.get_by_test_id("force-value").screenshot())) > 100
    context.close()
