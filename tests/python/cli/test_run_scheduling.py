"""`palpate run --cpus --priority`: in place of what the scene says, refused by the names that were typed."""

from __future__ import annotations

import pytest
from command_line import run
from conftest import box_mesh

import palpate
from palpate.cli.run_file import RunOptions, built_from

BEYOND = 100_000


@pytest.fixture
def scene(tmp_path):
    box_mesh().write(tmp_path / "box.vtu")
    text = '[body]\nmesh = "box.vtu"\n[supports]\nfixed = "z < min + 1mm"\n[device]\nmax_force = "3N"\ncpus = [0]\n'
    (tmp_path / "press.toml").write_text(text)
    return tmp_path / "press.toml"


def test_what_is_typed_stands_in_place_of_the_scene(scene):
    device = built_from(scene, RunOptions(priority=5)).scene.device
    assert (device.cpus, device.priority, device.max_force) == ((0,), 5, 3.0)
    bare = built_from(scene.parent / "box.vtu", RunOptions(unit="m", cpus="0")).scene.device
    assert (bare.cpus, bare.priority) == ((0,), 80)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"cpus": f"0,{BEYOND}"}, f"--cpus: this process may not run on CPU {BEYOND}, only on"),
        ({"cpus": "first"}, "--cpus: give numbers of processors, such as 1 or 2,3; got 'first'"),
        ({"cpus": "-1"}, "--cpus: give a list of processors"),
        ({"priority": 100}, "--priority: must be less than or equal to 99, got 100"),
    ],
)
def test_mistakes_are_told_by_the_option(scene, options, words):
    with pytest.raises(palpate.SceneError) as error:
        built_from(scene, RunOptions(**options))
    assert str(error.value).startswith(words)


def test_a_press_runs_with_what_was_typed(scene):
    result = run("run", scene, "--headless", "0.3", "--cpus", "0", "--priority", "0", cwd=scene.parent)
    assert result.returncode == 0, result
    assert "missed deadlines" in result.stdout
    assert "device.priority" not in result.stderr
