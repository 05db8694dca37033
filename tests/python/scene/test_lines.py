"""Every refusal of a scene file names a line of it; and what `run` refuses of its files, `info` refuses too."""

from __future__ import annotations

import re

import pytest
from command_line import refused, run
from conftest import box_mesh

import palpate

SCENE = """# A block.
[body]
mesh = "block.vtu"
unit = "m"

[supports]
fixed = "z < min + 1mm"

[tool]
radius = "6mm"
"""

MISTAKES = [
    ("mesh", ('mesh = "block.vtu"', 'mesh = "none.vtu"'), 3, "no such file"),
    ("store", ('mesh = "block.vtu"\nunit = "m"', 'store = "none.palpate"'), 3, "none.palpate"),
    ("store and supports", ('mesh = "block.vtu"\nunit = "m"', 'store = "none.palpate"'), 3, ""),
    ("unit", ('unit = "m"', 'unit = "parsec"'), 2, "unknown length unit 'parsec'"),
    ("predicate", ("z < min + 1mm", "z < min plus 1mm"), 7, "cannot read the predicate"),
    ("nothing held", ("z < min + 1mm", "z < -3"), 6, "no node satisfies supports.fixed"),
    ("no such node", ('"z < min + 1mm"', "[123456]"), 2, "node 123456 does not exist"),
    ("key in quotes", ('radius = "6mm"', '"radius" = -6'), 10, "greater than 0"),
    ("key of dots", ('[tool]\nradius = "6mm"', "[view]\n[body.refine]"), 10, ""),
    ("table in quotes", ('[tool]\nradius = "6mm"', '["tool"]\n\'radius\' = "wide"'), 10, "is not a length"),
    ("table with blanks", ('[tool]\nradius = "6mm"', '[ tool ]\nradius = "wide"'), 10, "is not a length"),
    ("no body at all", ('[body]\nmesh = "block.vtu"\nunit = "m"\n', ""), 3, "missing"),
    ("tool of a file", ('radius = "6mm"', 'shape = "none.stl"'), 10, "no such file"),
    ("quadratic", ('unit = "m"', 'unit = "m"\nelement = "cubic"'), 5, ""),
    ("Arabic digit", ("6mm", "٣mm"), 10, "'٣mm' is not a length"),
]


@pytest.fixture
def folder(tmp_path):
    box_mesh(cells=(2, 2, 2)).write(tmp_path / "block.vtu")
    return tmp_path


@pytest.mark.parametrize(("name", "change", "line", "words"), MISTAKES, ids=[mistake[0] for mistake in MISTAKES])
def test_a_refusal_names_its_line_in_building_and_in_telling(folder, name, change, line, words):
    text = SCENE if name != "store" else SCENE.replace('[supports]\nfixed = "z < min + 1mm"\n', "\n\n")
    (folder / "scene.toml").write_text(text.replace(*change), encoding="utf-8")
    messages = []
    for look in (lambda scene: palpate.Simulation(scene.build(False)), palpate.Scene.require_files):
        with pytest.raises(palpate.Error) as refusal:
            look(palpate.Scene.read(folder / "scene.toml"))
        messages.append(str(refusal.value))
    for message in messages:
        found = re.search(r"scene\.toml:(\d+): ", message)
        assert found and int(found[1]) == line and words in message and "\n" not in message, message


def test_info_accepts_what_run_does_and_no_more(folder):
    (folder / "scene.toml").write_text(SCENE)
    assert "scene of block" in run("info", "scene.toml", cwd=folder).stdout
    (folder / "scene.toml").write_text(SCENE.replace("block.vtu", "none.vtu"))
    refused(run("info", "scene.toml", cwd=folder), "scene.toml:3: mesh: ", "none.vtu: no such file")
