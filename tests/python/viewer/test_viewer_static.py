"""Tests of the page that need no server, once more on a page without one: a worker is its carrier."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from browser import MARKS, opened
from web_site import served

from palpate.scene import model_scene
from palpate.viewer.site import write_site
from viewer import test_viewer_controls as controls
from viewer import test_viewer_page as pages

pytestmark = MARKS

QUICK = [
    controls.test_reset_puts_all_sliders_back_at_once,
    pages.test_a_drag_slides_along_the_surface,
    pages.test_a_grab_pulls,
    pages.test_a_press_begins_at_the_surface_and_comes_to_a_gentle_depth,
    pages.test_deformation_drawn_larger_is_marked,
    pages.test_stiffness_scales_the_force_at_once,
    pages.test_the_size_of_the_body_is_told,
]
LONG = [
    pages.test_felt_stiffness_is_the_slope_of_force_against_depth,
    pages.test_friction_bounds_the_force_along_the_surface,
    pages.test_the_depth_is_told_by_wheel_second_button_and_shift,
]


@pytest.fixture(scope="module")
def program(cache, tmp_path_factory):
    """The paper's liver, as in the demo, from a plain file server."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        folder = tmp_path_factory.mktemp("static") / "site"
        write_site([("liver", model_scene("liver", paper=True).build(progress=False))], folder)
    with served(folder) as address:
        yield SimpleNamespace(address=f"{address}/index.html")


@pytest.fixture
def page(chromium, program):
    with opened(chromium, program) as page:
        yield page


@pytest.mark.parametrize("test", QUICK, ids=lambda test: test.__name__)
def test_of_the_page(page, test):
    test(page)


@pytest.mark.slow
@pytest.mark.parametrize("test", LONG, ids=lambda test: test.__name__)
def test_of_the_page_that_takes_long(page, test):
    test(page)
