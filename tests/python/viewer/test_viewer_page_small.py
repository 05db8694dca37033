"""The page where there is little room, and what it says: nothing overlaps, and no word is lost or stays for ever."""

from __future__ import annotations

import contextlib
import itertools

import pytest
from browser import MARKS, Program, opened, repeated_after_overruns, state, until
from playwright.sync_api import Error

pytestmark = MARKS

SIZES = [(800, 500), (844, 390), (667, 375), (1280, 720)]


@pytest.fixture(scope="module")
def block_program(cache, tmp_path_factory):
    """The example's block with a mesh region of a name longer than the panel is wide."""
    from pathlib import Path

    examples = Path(__file__).resolve().parents[3] / "examples"
    folder = tmp_path_factory.mktemp("small")
    text = (examples / "block.toml").read_text().replace('"block.obj"', f'"{examples / "block.obj"}"')
    (folder / "block.toml").write_text(text)
    started = Program(cache, str(folder / "block.toml"), command="run")
    yield started
    assert started.stop() == 0


def boxes(page, names) -> dict[str, tuple[float, float, float, float]]:
    """Left, top, right and bottom of what is shown."""
    found = {}
    for name in names:
        box = page.locator(f"#{name}").bounding_box() if page.locator(f"#{name}").is_visible() else None
        if box is not None:
            found[name] = (box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"])
    return found


@pytest.mark.quick(4)
@pytest.mark.parametrize("size", SIZES)
def test_nothing_over_the_picture_overlaps(chromium, block_program, size):
    with opened(chromium, block_program, size) as page:
        shown = boxes(page, ("readout", "legend", "hint", "scale", "panel"))
        for (one, a), (other, b) in itertools.combinations(shown.items(), 2):
            apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
            assert apart, f"{one} {a} overlaps {other} {b} at {size}"
        # Words in a strip of a few letters are not read.
        if "hint" in shown:
            left, _, right, _ = shown["hint"]
            assert right - left > 180


def test_a_long_entry_stays_in_the_panel(chromium, block_program):
    with opened(chromium, block_program, (1280, 720)) as page:
        page.evaluate(
            "() => document.getElementById('field').append(new Option('By the regions of a very long name '.repeat(4)))"
        )
        page.locator("#field").select_option(index=page.locator("#field option").count() - 1)
        found = boxes(page, ("field", "panel"))
        assert found["field"][2] <= found["panel"][2] - 8


def test_a_stiffness_that_is_not_positive_is_not_taken(chromium, block_program):
    with opened(chromium, block_program) as page:
        number = page.get_by_test_id("stiffness-value")
        before = number.input_value()
        for typed in ("-5", "0", "-5 kPa"):
            number.fill(typed)
            number.press("Enter")
            page.get_by_text(f"Material stiffness must be positive: '{typed}' is not taken, {before} stays").wait_for()
            assert number.input_value() == before


@pytest.mark.slow
def test_notices_leave_by_themselves(chromium, block_program):
    with opened(chromium, block_program) as page:
        page.get_by_test_id("stiffness-value").fill("many")
        page.get_by_test_id("stiffness-value").press("Enter")
        notice = page.locator(".banner-notice")
        notice.wait_for()
        notice.wait_for(state="detached", timeout=30_000)


def test_a_press_on_the_inside_of_a_cut_is_answered(chromium, block_program):
    with opened(chromium, block_program) as page:
        page.locator("#show-cutaway").click()
        box = page.locator("#canvas").bounding_box()
        # The middle of the picture is the face of the cut.
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.down()
        page.mouse.up()
        page.get_by_text("No tool reaches the inside that the cut shows").wait_for()


@pytest.mark.slow
def test_a_press_goes_on_with_another_tool(chromium, block_program):
    """The list is changed by its keys while the pointer is held down: the new tool presses there when it has come."""
    with opened(chromium, block_program) as page:
        box = page.locator("#canvas").bounding_box()

        def change_the_tool_while_pressing():
            if state(page)["shape"] != "sphere":
                page.locator("#shape").select_option("sphere")
                until(page, lambda s: s["shape"] == "sphere")
            page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            page.mouse.down()
            until(page, lambda s: s["forceMagnitude"] > 0.01)
            page.evaluate("""() => {
                const shape = document.getElementById('shape');
                shape.value = 'punch';
                shape.dispatchEvent(new Event('change'));
            }""")
            # Choosing it has let go; the pointer presses again through the box that shows what is being prepared.
            page.mouse.up()
            with contextlib.suppress(Error):
                page.locator("#status").wait_for(timeout=5e3)
            page.mouse.down()
            until(page, lambda s: s["shape"] == "punch" and s["forceMagnitude"] > 0.01)
            page.mouse.up()

        repeated_after_overruns(page, change_the_tool_while_pressing)
