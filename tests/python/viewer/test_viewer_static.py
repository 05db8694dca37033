"""Tests of the page that need no server, once more on a page without one: a worker is its carrier."""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Callable
from types import SimpleNamespace

import pytest
from browser import MARKS, opened
from web_site import served

import palpate
from palpate.cli.impulse import impulse_scene
from palpate.scene import model_scene
from palpate.viewer.site import write_site
from viewer import test_viewer_controls as controls
from viewer import test_viewer_first_minute as first_minute
from viewer import test_viewer_look as look
from viewer import test_viewer_page as pages
from viewer import test_viewer_page_motion as motion
from viewer import test_viewer_thin as thin
from viewer import test_viewer_two_tools as two_tools

# Slow, for the program of such a page is built for campaigns only.
pytestmark = [*MARKS, pytest.mark.slow]

# Modules whose tests open the page of the paper's liver, and what their tests may ask for.
MODULES = [controls, first_minute, look, pages]
FIXTURES = {"capsys", "chromium", "page", "program", "tmp_path"}
# Tests of the page that a server is needed for, and why.
NEEDS_SERVER: dict[Callable, str] = {
    pages.test_an_address_without_the_token_is_explained: "a file server asks for no token",
    pages.test_a_page_from_another_origin_cannot_connect: "nothing to connect to",
    pages.test_leaving_the_page_lets_go: "each page has a loop of its own: nobody watches another's",
    pages.test_fields_have_a_legend: "stresses",
    pages.test_cut_away_and_another_model: "stresses",
    look.test_a_range_is_locked_where_it_is_or_where_it_is_typed: "stresses",
}


def page_tests() -> list:
    """Tests of the modules that need no server, each with the first of its parameter sets."""
    tests = [
        (test, parameters)
        for module in MODULES
        for name, test in vars(module).items()
        if name.startswith("test_") and test not in NEEDS_SERVER
        for parameters in [first_parameters(test)]
        if set(inspect.signature(test).parameters) <= FIXTURES | set(parameters)
    ]
    return [pytest.param(*one, id=one[0].__name__) for one in tests]


def first_parameters(test) -> dict:
    """First set of parameters of a test, by name."""
    found = {}
    for mark in getattr(test, "pytestmark", []):
        if mark.name == "parametrize":
            names, sets = mark.args[:2]
            names = [name.strip() for name in names.split(",")] if isinstance(names, str) else names
            found |= dict(zip(names, sets[0] if len(names) > 1 else [sets[0]], strict=True))
    return found


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
    """The paper's liver, as in the demo, and another body to choose."""
    scenes = {name: model_scene(name, paper=True) for name in ("liver", "beam")}
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
def page(chromium, program, test):
    with opened(chromium, program, sharpness=getattr(inspect.getmodule(test), "SHARPNESS", 0.25)) as page:
        yield page


@pytest.mark.campaign(6)
@pytest.mark.parametrize(("test", "parameters"), page_tests())
def test_of_the_page(request, test, parameters):
    wanted = [name for name in inspect.signature(test).parameters if name not in parameters]
    test(**{name: request.getfixturevalue(name) for name in wanted}, **parameters)


def test_stresses_are_listed_but_cannot_be_chosen(chromium, program):
    with opened(chromium, program) as page:
        options = page.locator("#field option").evaluate_all(
            "all => all.map(o => [o.value, o.textContent, o.disabled])"
        )
    disabled = {name: title for name, title, is_disabled in options if is_disabled}
    assert disabled == {
        "von_mises": "Von Mises stress: needs a server",
        "principal_stress": "First principal stress: needs a server",
    }
    assert {"displacement", "strain"} <= {name for name, *_ in options}


@pytest.mark.parametrize(("test", "scene"), OTHERS, ids=lambda value: getattr(value, "__name__", value))
def test_of_the_page_of_another_scene(chromium, site_of_others, test, scene):
    program = SimpleNamespace(address=f"{site_of_others}/index.html?scene={scene}")
    if "size" in inspect.signature(test).parameters:
        test(chromium, program, (1280, 720))
    else:
        test(chromium, program)


def test_of_the_page_of_a_body_in_motion(chromium, moving_site):
    with opened(chromium, SimpleNamespace(address=f"{moving_site}/index.html?scene=beam")) as page:
        motion.test_a_click_strikes_in_motion(page)
