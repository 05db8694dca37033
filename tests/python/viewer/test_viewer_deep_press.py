"""Deep presses in the page: the error of the force is shown, or the strain is warned of if the law is linear."""

from __future__ import annotations

import re

import pytest
from browser import MARKS, Program, opened, press, settled_force, until, wheel

pytestmark = MARKS


def press_15_mm(page) -> None:
    """Press the liver by 15 mm."""
    page.locator("#reset").click()
    page.get_by_test_id("strain-limit").evaluate(
        "e => { e.value = 51; e.dispatchEvent(new Event('input', {bubbles: true})); }"
    )
    press(page)
    wheel(page, 1100)
    until(page, lambda s: s["depth"] > 0.0149)
    settled_force(page)


@pytest.mark.slow
def test_a_deep_press_of_a_neo_hookean_liver_states_its_error(chromium, cache):
    program = Program(cache, "liver")
    with opened(chromium, program) as page:
        press_15_mm(page)
        assert float(page.get_by_test_id("force-value").inner_text()) > 0.5
        error = page.get_by_test_id("force-error").inner_text()
        assert re.fullmatch(r"±\d+ %", error)
        warning = page.locator("#strain-warning").text_content()
        assert "linear elasticity" not in warning
        page.mouse.up()
    assert program.stop() == 0


@pytest.mark.slow
def test_a_deep_press_of_a_linear_liver_warns(page):
    """The paper's liver, which `program` has, is linear."""
    press_15_mm(page)
    warning = page.locator("#strain-warning")
    until(page, lambda _: warning.is_visible())
    assert "linear elasticity is accurate up to about 10 %" in warning.inner_text()
    assert page.get_by_test_id("force-error").inner_text() == ""
    page.mouse.up()
    # Other tests of the page use the same program.
    page.locator("#reset").click()
    until(page, lambda _: page.locator("#strain-limit-value").input_value() == "30 %")
