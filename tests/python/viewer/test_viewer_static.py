"""Tests of the page that need no server, once more on a page without one: a worker is its carrier."""

from __future__ import annotations

import contextlib
import inspect
from types import SimpleNamespace

import pytest
from browser import MARKS, opened
from web_site import served

import palpate
from palpate.cli.impulse import impulse_scene
from palpate.scene import model_scene
from palpate.viewer.site import write_site
from viewer import test_viewer_controls as controls
from viewer import test_viewer_page as pages
from viewer import test_viewer_page_motion as motion
from viewer import test_viewer_thin as thin
from viewer import test_viewer_two_tools as two_tools

pytestmark = MARKS

# The pointer and a setting on their way to the worker and back; the others take the same way.
QUICK = [
    controls.test_reset_puts_all_sliders_back_at_once,
    pages.test_a_grab_pulls,
]
LONG = [
    pages.test_a_drag_slides_along_the_surface,
    pages.test_a_press_begins_at_the_surface_and_comes_to_a_gentle_depth,
    pages.test_the_size_of_the_body_is_told,
    controls.test_a_number_is_typed_and_a_double_click_brings_the_default,
    pages.test_deformation_drawn_larger_is_marked,
    pages.test_felt_stiffness_is_the_slope_of_force_against_depth,
    pages.test_friction_bounds_the_force_along_the_surface,
    pages.test_stiffness_scales_the_force_at_once,
    pages.test_the_depth_is_told_by_wheel_second_button_and_shift,
]
# Those of scenes of their own, by the name of the scene.
OTHERS = [
    (thin.test_a_thin_part_is_noticed_while_it_is_pressed, "thin"),
    (two_tools.test_two_tools_on_two_bodies, "pair"),
    (two_tools.test_a_pinned_tool_by_buttons, "pair"),
]


@contextlib.contextmanager
def served_site(scenes: dict[str, palpate.Scene], cache, folder):
    """Address of a static page of the scenes, from a plain file server."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        write_site([(name, scene.build(progress=False)) for name, scene in scenes.items()], folder, gallery=False)
    with served(folder) as address:
        yield address


@pytest.fixture(scope="module")
def site(cache, tmp_path_factory):
    """The paper's liver, as in the demo."""
    scenes = {"liver": model_scene("liver", paper=True)}
    with served_site(scenes, cache, tmp_path_factory.mktemp("static") / "site") as address:
        yield address


@pytest.fixture(scope="module")
def site_of_others(cache, tmp_path_factory):
    files = tmp_path_factory.mktemp("scenes")
    scenes = {
        "thin": palpate.Scene.read(thin.scene_file(files)),
        "pair": palpate.Scene(body=two_tools.TWO_LIVERS, tool=[{}, {}]),
    }
    with served_site(scenes, cache, tmp_path_factory.mktemp("static") / "site") as address:
        yield address


@pytest.fixture(scope="module")
def moving_site(cache, tmp_path_factory):
    """The paper's beam in motion, with a strike of its own."""
    with served_site(
        {"beam": impulse_scene("beam", paper=True)}, cache, tmp_path_factory.mktemp("static") / "site"
    ) as address:
        yield address


@pytest.fixture(scope="module")
def program(site):
    return SimpleNamespace(address=f"{site}/index.html?scene=liver")


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


@pytest.mark.slow
@pytest.mark.parametrize(("test", "scene"), OTHERS, ids=lambda value: getattr(value, "__name__", value))
def test_of_the_page_of_another_scene(chromium, site_of_others, test, scene):
    program = SimpleNamespace(address=f"{site_of_others}/index.html?scene={scene}")
    if "size" in inspect.signature(test).parameters:
        test(chromium, program, (1280, 720))
    else:
        test(chromium, program)


@pytest.mark.slow
def test_of_the_page_of_a_body_in_motion(chromium, moving_site):
    with opened(chromium, SimpleNamespace(address=f"{moving_site}/index.html?scene=beam")) as page:
        motion.test_a_click_strikes_in_motion(page)
