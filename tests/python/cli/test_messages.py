"""Mistakes with files and scenes: one line that says what is wrong, where, and what to do."""

from __future__ import annotations

import socket

import numpy as np
import pytest
import trimesh
from command_line import refused, run
from conftest import box_mesh

import palpate
from palpate.mesh.surface_file import load_surface

GMSH_1 = """$NOD
4
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
$ENDNOD
$ELM
1
1 4 1 1 4 1 2 3 4
$ENDELM
"""


def test_the_first_format_of_gmsh_is_read(tmp_path):
    """One that is cut short is refused."""
    (tmp_path / "old.msh").write_text(GMSH_1)
    assert "4 nodes, 1 tetrahedra" in run("info", "old.msh", cwd=tmp_path).stdout
    (tmp_path / "old.msh").write_text(GMSH_1[: GMSH_1.index("$ELM") + 8])
    refused(run("info", "old.msh", cwd=tmp_path), "old.msh", "is no whole file of Gmsh's first format")


@pytest.mark.parametrize("footer", ["end solid part", "END SOLID", "  end solid part\n"])
def test_stl_text_with_a_footer_of_two_words_is_read(footer, tmp_path):
    text = trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box((0.05, 0.04, 0.03)))
    lines = text.strip().splitlines()
    head = lines[0].split()[0] + " part"
    (tmp_path / "part.stl").write_text("\n".join([head, *lines[1:-1], footer]))
    shape = load_surface(tmp_path / "part.stl").shape
    shape.merge_vertices()
    assert shape.is_watertight and shape.volume == pytest.approx(0.05 * 0.04 * 0.03)


@pytest.mark.parametrize("ending", [".stl", ".msh", ".toml", ".palpate"])
def test_a_folder_is_told_from_a_file(ending, tmp_path):
    (tmp_path / f"a{ending}").mkdir()
    refused(run("info", f"a{ending}", cwd=tmp_path), f"a{ending} is a folder")


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path):
    trimesh.creation.box((0.05, 0.04, 0.03)).export(tmp_path / "box.stl")
    (tmp_path / "made.vtu").mkdir()
    refused(run("mesh", "box.stl", "made.vtu", cwd=tmp_path), "made.vtu is a folder")
    make = ("precompute", "box.stl", "--fix", "z < min + 5mm", "-o")
    result = run(*make, "nowhere/box.palpate", cwd=tmp_path)
    refused(result, "there is no folder nowhere")
    assert result.stdout == ""


BUSY = ("port", "is in use: choose another with --port, or --port 0 for a free one")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "scene.toml", "--headless", "1", "--out", "taken"), ("taken is a file: --out names a folder",)),
        (("demo", "--headless", "1", "--out", "taken/in"), ("taken is a file: --out names a folder",)),
        (("exam", "nodule", "--out", "taken"), ("taken is a file: --out names a folder",)),
        (("study", "study.toml", "--out", "taken"), ("taken is a file: --out names a folder",)),
        (("compare", "a.mcap", "b.mcap", "--out", "taken"), ("taken is a file: --out names a folder",)),
        (("map", "scene.toml", "--grid", "1cm", "--depth", "1mm", "--out", "taken"), ("taken is a file",)),
        (("run", "scene.toml", "--headless", "1", "--record", "old.mcap"), ("old.mcap: exists",)),
        (("run", "scene.toml", "--record", "old.mcap"), ("old.mcap: exists",)),
        (("run", "scene.toml", "--record", "no/a.mcap"), ("no/a.mcap: there is no folder no",)),
        (("demo", "--record", "a.foo"), ("--record a.foo: a recording ends in .mcap: name it a.mcap",)),
        (("run", "scene.toml", "--port", "0", "--map", "none.vtu"), ("none.vtu: no such file",)),
        (("run", "scene.toml", "--port", "BUSY"), BUSY),
        (("demo", "--port", "BUSY"), BUSY),
        (("exam", "nodule", "--port", "BUSY"), BUSY),
    ],
)
def test_places_that_are_taken_are_refused_before_the_work(words, message, tmp_path, monkeypatch):
    def work(*_, **__):
        raise AssertionError("working")

    for place in ("palpate.scene.Scene.build", "palpate.exam.Library.__init__", "palpate.simulation.Recording.load"):
        monkeypatch.setattr(place, work)
    monkeypatch.setattr("palpate.study.Study.read", work)
    (tmp_path / "scene.toml").write_text('[body]\nmodel = "beam"\n')
    (tmp_path / "taken").write_text("what I have written by hand")
    (tmp_path / "old.mcap").write_text("a recording")
    before = sorted(path.name for path in tmp_path.iterdir())
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        found = run(*(port if word == "BUSY" else word for word in words), cwd=tmp_path)
    refused(found, *message)
    assert found.stdout == "" and sorted(path.name for path in tmp_path.iterdir()) == before


def test_printed_commands_can_be_typed(tmp_path):
    trimesh.creation.box((0.05, 0.04, 0.03)).export(tmp_path / "my box.stl")
    found = run("info", "my box.stl", cwd=tmp_path)
    assert "palpate mesh 'my box.stl' 'my box.vtu' --unit m" in found.stdout


def test_a_name_with_another_ending_is_offered(tmp_path):
    trimesh.creation.box().export(tmp_path / "Organ.stl")
    refused(run("mesh", "organ.obj", "out.vtu", cwd=tmp_path), "organ.obj: no such file; there is Organ.stl")


@pytest.mark.parametrize("predicate", ["z < 1/0", "z < 0/0", "z < 1/(x-x)", "z/(x-x) < 1"])
def test_a_division_by_zero_is_not_a_support_everywhere(predicate):
    nodes = np.random.default_rng(0).uniform(size=(7, 3))
    with pytest.raises(palpate.BodyError, match="divides by zero"):
        palpate.body.parse(predicate)(nodes)


def test_a_number_beyond_floats_is_named():
    for text in ("z < 1e308*1e10", f"z < {'9' * 400}"):
        with pytest.raises(palpate.BodyError, match="too large"):
            palpate.body.parse(text)(np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[dynamics]\nmodes = 'some'", "a.toml:2: dynamics.modes: give how many, such as 200, or 'all'; got 'some'"),
        ("[dynamics]\nmodes = 0", "a.toml:2: dynamics.modes: give how many, such as 200, or 'all'; got 0"),
        ("tool = 5", r"a.toml:1: tool: must be a table: write \[tool\] on a line of its own.*, got 5"),
        ("tool = []", r"a.toml:1: tool: needs at least 1 entry, got \[\]"),
        ("[[tool]]\n" * 5, "a.toml:1: tool: takes at most 4 entries, got 5"),
        ("[[tool]]\n[[tool]]\ncontact = 'x'", "a.toml:3: tool.contact: must be 'local', 'patch' or 'node', got 'x'"),
        ("[[tool]]\n[[tool]]\nfriction = 30", "a.toml:3: tool.friction: must be less than or equal to 10, got 30"),
        (
            "[supports]\nfixed = 3.5",
            "a.toml:2: supports.fixed: give a predicate, such as .*, a list of node numbers, or a file of them",
        ),
        ("[[region]]\nmesh_region = 1.5", "a.toml:2: region.mesh_region: give the number or the name of a region"),
        ("[view]\nstrain_limit = 'x'", "a.toml:2: view.strain_limit: must be a number, got 'x'"),
    ],
)
def test_values_of_a_wrong_kind_are_explained_in_words(table, message, tmp_path):
    (tmp_path / "a.toml").write_text(f'{table}\n[body]\nmodel = "beam"\n')
    with pytest.raises(palpate.SceneError, match=message) as raised:
        palpate.Scene.read(tmp_path / "a.toml")
    assert "\n" not in str(raised.value)


def test_a_scene_made_by_a_program_is_refused_by_the_same_words(tmp_path):
    box_mesh().write(tmp_path / "box.vtu", unit="mm")
    with pytest.raises(palpate.SceneError, match=r"unknown key 'body\.modl'; did you mean 'model'"):
        palpate.Scene(body={"modl": "beam"})
    with pytest.raises(palpate.SceneError, match=r"supports\.fixed is missing"):
        palpate.Scene(body={"mesh": str(tmp_path / "box.vtu"), "unit": "mm"}).build()
