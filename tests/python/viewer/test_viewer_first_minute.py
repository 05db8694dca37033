"""The page as someone sees it first: tissue, one sentence, few controls; by pointer, keys and screen reader."""

from __future__ import annotations

import io
import itertools
import re

import numpy as np
import pytest
from browser import MARKS, drawn, eventually, opened, press, settled_depth, state, until
from PIL import Image

pytestmark = MARKS

# A laptop, a small window, a phone upright and on its side, a 4K screen.
SIZES = [(1440, 900), (800, 500), (390, 844), (844, 390), (3840, 2160)]
CONTROLS = "button, select, input, [tabindex='0']"
# Whether an element of the page is seen.
SEEN = "const seen = e => e.checkVisibility({visibilityProperty: true});"
BOXES = "#readout, #readout p, #legend, #hint, .panel button, .panel .row, .panel label"
CUT_OFF = f"""() => {{
    {SEEN}
    const cut = e => e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline';
    return [...document.querySelectorAll('{BOXES}')].filter(e => seen(e) && cut(e)).map(e => e.id || e.textContent);
}}"""
MET_BY_A_POINTER = f"""() => {{
    {SEEN}
    const met = e => {{
        const b = e.getBoundingClientRect();
        const at = document.elementFromPoint(b.left + b.width / 2, b.top + b.height / 2);
        return at !== null && (e === at || e.contains(at));
    }};
    const controls = [...document.querySelectorAll("{CONTROLS}")];
    return controls.filter(e => seen(e) && e.id !== 'canvas').map(e => [e.id, met(e)]);
}}"""
ENABLED = f"""() => {{
    {SEEN}
    return [...document.querySelectorAll("{CONTROLS}")].filter(e => seen(e) && !e.disabled).map(e => e.id);
}}"""
READOUTS = """() => [...document.querySelectorAll('[data-readout]')].filter(e => e.checkVisibility()).map(e => {
    const force = e.querySelector('#force-value') && document.getElementById('force-label');
    const label = force ?? e.querySelector('dt, span');
    return {label: label.textContent, unit: e.querySelector('.unit')?.textContent ?? '', text: e.textContent};
})"""
# Numbers of the box with the force that belong to no readout.
BARE_NUMBERS = r"""() => [...document.querySelectorAll('#readout b, #readout span')]
    .filter(e => e.checkVisibility() && /^[\d.+\u2212-]+$/.test(e.textContent.trim()) && !e.closest('[data-readout]'))
    .map(e => e.textContent)"""


def first_page(chromium, program, size=(1280, 720), **options):
    """The page in a browser that has never seen it."""
    return opened(chromium, program, size, more=False, **options)


def shown_boxes(page, names) -> dict[str, tuple[float, float, float, float]]:
    """Left, top, right and bottom of what is seen."""
    found = {}
    for name in names:
        element = page.locator(f"#{name}")
        if element.is_visible():
            box = element.bounding_box()
            found[name] = (box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"])
    return found


def nothing_overlaps_or_is_cut(page, size) -> set[str]:
    boxes = shown_boxes(page, ("readout", "legend", "hint", "scale", "panel"))
    for name, (left, top, right, bottom) in boxes.items():
        assert left >= 0 and top >= 0 and right <= size[0] + 0.5 and bottom <= size[1] + 0.5, (name, boxes[name])
    for (one, a), (other, b) in itertools.combinations(boxes.items(), 2):
        apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        assert apart, f"{one} {a} overlaps {other} {b}"
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == list(size)
    cut = page.evaluate(CUT_OFF)
    assert cut == []
    return set(boxes)


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_the_first_page_has_room_for_all_that_it_shows(chromium, program, size):
    with first_page(chromium, program, size, sharpness=0.25) as page:
        # The legend goes with the strain of the test before.
        page.get_by_test_id("legend-max").wait_for(state="hidden")
        at_rest = nothing_overlaps_or_is_cut(page, size)
        assert {"readout", "hint", "panel"} <= at_rest
        assert "legend" not in at_rest
        # All controls are seen without scrolling, and a pointer meets each of them.
        met = page.evaluate(MET_BY_A_POINTER)
        assert {"model", "shape", "stiffness", "more", "help-open"} <= {name for name, _ in met}
        assert [name for name, is_met in met if not is_met] == []
        press(page, 3)
        until(page, lambda s: s["strain"] > 0.02)
        page.get_by_test_id("legend-max").wait_for()
        assert "legend" in nothing_overlaps_or_is_cut(page, size)
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0)
        page.locator("#more").click()
        # The body is framed anew beside the panel.
        drawn(page, 5)
        # The force has digits in all directions then, and the notice of large strain needs room.
        press(page, 3)
        until(page, lambda s: s["strain"] > 0.02)
        nothing_overlaps_or_is_cut(page, size)
        page.mouse.up()


@pytest.mark.slow
def test_letters_grow_with_a_very_large_screen(chromium, program):
    heights = []
    for size in ((1440, 900), (3840, 2160)):
        with first_page(chromium, program, size, sharpness=0.25) as page:
            heights.append(page.locator("#model").bounding_box()["height"])
    assert heights[1] > 1.6 * heights[0]


def test_first_there_are_few_controls_one_sentence_and_no_plots(chromium, program):
    with first_page(chromium, program) as page:
        for name in ("field", "friction", "strain-limit", "shown-scale", "show-wireframe", "plots", "statistics"):
            assert page.locator(f"#{name}").is_hidden(), name
        sentence = page.get_by_test_id("hint").inner_text().replace("×", "").strip()
        assert sentence.count(".") == 1 and sentence.endswith(".") and "press" in sentence
        # Who has pressed knows it.
        press(page, 3)
        until(page, lambda s: s["contacts"] > 0)
        assert page.get_by_test_id("hint").is_visible()
        page.mouse.up()
        page.get_by_test_id("hint").wait_for(state="hidden")


def test_keys_of_the_help_cover_no_text(chromium, program):
    with first_page(chromium, program, (1280, 800)) as page:
        page.keyboard.press("?")
        page.locator("#help-keys").wait_for()
        caps, texts = (
            page.eval_on_selector_all(f"#help-keys {part}", "all => all.map(e => e.getBoundingClientRect().toJSON())")
            for part in ("dt > :last-child", "dd")
        )
        assert len(caps) == len(texts) > 10
        assert all(cap["right"] <= text["left"] for cap, text in zip(caps, texts, strict=True))


@pytest.mark.slow
def test_more_is_remembered(chromium, program):
    with first_page(chromium, program) as page:
        more, body = page.get_by_test_id("more"), page.get_by_test_id("more-body")
        for wanted in (True, False):
            assert body.is_visible() is not wanted
            more.click()
            for _ in range(2):
                assert body.is_visible() is wanted
                assert more.get_attribute("aria-expanded") == str(wanted).lower()
                page.reload()
                until(page, lambda s: s["frames"] > 3)


def test_the_key_of_plots_opens_more(chromium, program):
    with first_page(chromium, program) as page:
        page.keyboard.press("p")
        assert page.locator("#plots").is_visible()


@pytest.mark.quick(2)
@pytest.mark.parametrize("more", [False, True])
def test_tab_reaches_every_control_and_each_has_a_name(chromium, program, more):
    with opened(chromium, program, more=more) as page:
        if not more:
            # The legend goes with the strain of the test before.
            page.get_by_test_id("legend-max").wait_for(state="hidden")
        wanted = page.evaluate(ENABLED)
        assert len(wanted) > (25 if more else 9) and all(wanted)
        page.evaluate("document.activeElement.blur()")
        reached = []
        for _ in range(2 * len(wanted)):
            page.keyboard.press("Tab")
            reached.append(page.evaluate("document.activeElement.id"))
        assert set(wanted) <= set(reached), set(wanted) - set(reached)
        tree = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
        roles = {"button", "combobox", "slider", "textbox", "spinbutton", "checkbox", "application"}
        named = [
            (node["role"]["value"], node.get("name", {}).get("value", ""))
            for node in tree
            if not node.get("ignored") and node.get("role", {}).get("value") in roles
        ]
        assert len(named) >= len(wanted)
        # A sign is read out as nothing, or as its own name.
        assert [(role, name) for role, name in named if not re.search("[A-Za-z]", name)] == []
        # Two controls of one name cannot be told apart.
        repeated = [one for one in set(named) if named.count(one) > 1]
        assert repeated == []


@pytest.mark.slow
def test_every_number_has_a_label_and_a_unit(chromium, program):
    with opened(chromium, program) as page:
        press(page, 2)
        readouts = page.evaluate(READOUTS)
        result = {readout["label"].strip(): readout["unit"].strip() for readout in readouts}
        assert result.pop("Ticks") == "" and result.pop("Missed deadlines") == ""
        assert result == {
            "Force": "N",
            "Felt stiffness": "N/mm",
            "Depth": "mm",
            "Largest strain": "%",
            "Contact radius": "mm",
            "x, y, z": "N",
            "Pictures": "per s",
        }
        assert all(re.search(r"\d", readout["text"]) for readout in readouts)
        # No number of the box with the force stands outside of them.
        bare = page.evaluate(BARE_NUMBERS)
        assert bare == []
        # Stiffness of the material and of the contact have names and units of their own.
        assert page.locator("label[for=stiffness]").inner_text() == "Material stiffness"
        assert page.get_by_test_id("stiffness-value").input_value().endswith(" kPa")
        page.mouse.up()


def hue(page, x: float, y: float) -> np.ndarray:
    """Shares of red, green and blue around a place of the page."""
    clip = {"x": round(x) - 3, "y": round(y) - 3, "width": 7, "height": 7}
    color = np.asarray(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB"), dtype=float).mean(axis=(0, 1))
    return color / color.sum()


def is_tissue(color: np.ndarray) -> bool:
    return color[0] > 1.5 * color[1] and color[0] > 1.5 * color[2]


@pytest.mark.slow
def test_colours_come_over_the_tissue_where_it_is_strained_or_with_a_field(chromium, program):
    with first_page(chromium, program, sharpness=1.0) as page:
        x, y = page.evaluate("window.palpate.pickPoint()")
        # In the picture below the tool, just beside its contact; and far from it.
        canvas = page.locator("#canvas").bounding_box()
        far = (canvas["x"] + 0.34 * canvas["width"], canvas["y"] + 0.5 * canvas["height"])
        place = (x, y + 60)
        assert is_tissue(hue(page, *place)) and is_tissue(hue(page, *far))
        press(page, 4, place=(x, y + 40))

        def greenest() -> float:
            """Largest share of green over red around the contact."""
            clip = {"x": x - 40, "y": y + 20, "width": 80, "height": 70}
            picture = np.asarray(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB"), dtype=float)
            return float(np.percentile(picture[..., 1] / picture[..., 0], 95))

        assert eventually(page, greenest, lambda seen: seen > 1.1) > 1.1
        assert is_tissue(hue(page, *far))
        assert page.get_by_test_id("legend-max").is_visible()
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0 and s["strain"] < 1e-4)
        assert eventually(page, greenest, lambda seen: seen < 0.85) < 0.85
        page.get_by_test_id("legend-max").wait_for(state="hidden")
        # A field that is chosen colours all of the body; tissue comes back.
        page.locator("#more").click()
        page.get_by_test_id("field-select").select_option("displacement")
        x, y = page.evaluate("window.palpate.pickPoint()")

        def look() -> np.ndarray:
            return hue(page, x, y + 50)

        chosen = eventually(page, look, lambda color: color[2] > 1.2 * color[0])
        assert chosen[2] > 1.2 * chosen[0]
        page.get_by_test_id("field-select").select_option("tissue")
        assert is_tissue(eventually(page, look, is_tissue))


@pytest.mark.slow
def test_a_reader_hears_the_force_once_it_rests(chromium, program):
    with first_page(chromium, program) as page:
        press(page)
        spoken = page.get_by_test_id("spoken")

        def is_of_now(text: str) -> bool:
            # A page whose frames come late takes a creeping force for one at rest, and speaks again after it.
            number = re.search(r"Force ([\d.]+) newtons", text)
            return number is not None and float(number[1]) == pytest.approx(state(page)["forceMagnitude"], rel=0.05)

        heard = eventually(page, spoken.text_content, is_of_now)
        assert is_of_now(heard)
        assert "felt stiffness" in heard and "depth" in heard
        page.mouse.up()
        eventually(page, spoken.text_content, lambda text: text == "Nothing is touched.")
        assert spoken.text_content() == "Nothing is touched."


@pytest.mark.slow
def test_the_body_is_pressed_and_turned_by_keys(chromium, program):
    with first_page(chromium, program) as page:
        page.locator("#canvas").focus()
        before = np.array(page.evaluate("window.palpate.view().towards"))
        page.keyboard.press("ArrowRight")
        after = np.array(page.evaluate("window.palpate.view().towards"))
        assert 0.9 < before @ after < 0.999
        page.keyboard.press("Space")
        gentle = until(page, lambda s: s["contacts"] == 1 and s["forceMagnitude"] > 0.01)
        first = settled_depth(page)
        page.keyboard.press("PageDown")
        assert settled_depth(page) > first
        for _ in range(4):
            page.keyboard.press("ArrowLeft")
        start = gentle["tools"][0]["position"]
        until(page, lambda s: np.linalg.norm(np.subtract(s["tools"][0]["position"], start)) > 3e-3)
        # The picture stands still while the tool slides.
        assert np.array(page.evaluate("window.palpate.view().towards")) @ after > 1 - 1e-9
        page.keyboard.press("Space")
        until(page, lambda s: s["contacts"] == 0)
        # A press does not stay when the focus goes on.
        page.keyboard.press("Space")
        until(page, lambda s: s["contacts"] == 1)
        page.keyboard.press("Tab")
        until(page, lambda s: s["contacts"] == 0)
