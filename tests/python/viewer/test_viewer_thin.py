"""The notice of a contact on a thin part, in the page: it comes and goes with the contact."""

from __future__ import annotations

from pathlib import Path

import pytest
from browser import MARKS, Program, drawn, opened, press, until
from conftest import box_mesh

pytestmark = MARKS

# Both on one table: the tool's radius is 8 mm, so that 6 mm are thin and 25 mm are not.
SCENE = """
[[body]]
name = "plate"
mesh = "plate.vtu"
unit = "m"
[body.supports]
fixed = "z < min + 1mm"

[[body]]
name = "block"
mesh = "block.vtu"
unit = "m"
position = ["90mm", "0mm", "0mm"]
[body.supports]
fixed = "z < min + 1mm"

[material]
youngs_modulus = "10kPa"
poissons_ratio = 0.45

[tool]
radius = "8mm"
"""
PLATE, BLOCK = 0, 1
WORDS = "Thinner than 1.5 tool radii: force up to 60 % too small"


def scene_file(folder: Path) -> Path:
    """Write the scene, a thin plate beside a block, and its meshes."""
    box_mesh((10, 10, 2), (0.06, 0.06, 0.006), jitter=0).write(folder / "plate.vtu")
    box_mesh((10, 10, 4), (0.06, 0.06, 0.025), jitter=0).write(folder / "block.vtu")
    (folder / "thin.toml").write_text(SCENE)
    return folder / "thin.toml"


@pytest.fixture(scope="module")
def table(cache, tmp_path_factory):
    started = Program(cache, str(scene_file(tmp_path_factory.mktemp("thin"))), command="run")
    yield started
    assert started.stop() == 0


def pressed(page, body: int) -> None:
    """Press on the top of a body; the button stays down."""
    press(page, place=page.evaluate("body => window.palpate.pickPoint(body)", body))
    drawn(page)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_a_thin_part_is_noticed_while_it_is_pressed(chromium, table, size):
    with opened(chromium, table, size) as page:
        notice, readout = page.get_by_test_id("thin-notice"), page.locator("#readout")
        assert notice.is_hidden()
        height = readout.bounding_box()["height"]
        pressed(page, PLATE)
        assert notice.is_visible() and notice.inner_text() == WORDS
        # On a telephone the readout must not grow over the body.
        assert size[0] > 800 or readout.bounding_box()["height"] <= height + 1
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0)
        drawn(page)
        assert notice.is_hidden()
        pressed(page, BLOCK)
        assert notice.is_hidden()
        page.mouse.up()
        until(page, lambda s: s["contacts"] == 0)
