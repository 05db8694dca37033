"""Studies: their numbers against SciPy, what they do not compute twice, and how their files' mistakes are told."""

from __future__ import annotations

import csv
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import trimesh
from command_line import refused, run
from conftest import box_mesh
from direct import patch_at, solve_with_patches

import palpate
from palpate.study import Study
from palpate.study import answers as answering

ROOT = Path(__file__).parents[3]

BASE = """
[body]
mesh = "box.vtu"
[material]
youngs_modulus = "10kPa"
poissons_ratio = 0.3
[supports]
fixed = "z < min + 1mm"
[[press]]
name = "top"
point = ["40mm", "25mm", "50mm"]
displacement = [0, "1mm", "-2mm"]
radius = "12mm"
[[press]]
point = ["20mm", "20mm", "50mm"]
displacement = ["-", "-", "-1mm"]
"""
REGION = '[[region]]\nshape = "box"\nlow = [0, 0, "20mm"]\nhigh = ["80mm", "50mm", "40mm"]\n'
GRID = """
[grid]
region.youngs_modulus = ["5kPa", "40kPa"]
material.poissons_ratio = [0.3, 0.45]
"""


@pytest.fixture
def folder(tmp_path):
    box_mesh(cells=(6, 4, 4)).write(tmp_path / "box.vtu")
    return tmp_path


def written(folder, text, name="study.toml"):
    (folder / name).write_text(text)
    return folder / name


@pytest.fixture
def operators(monkeypatch):
    """Scenes of which operators were computed."""
    computed = []
    compute = answering._operator
    monkeypatch.setattr(answering, "_operator", lambda scene: computed.append(scene) or compute(scene))
    return computed


def test_answers_are_those_of_scipy(folder):
    study = Study.read(written(folder, BASE + REGION + GRID))
    assert len(study.cases) == 4
    columns = study.run(folder / "out", progress=False).columns
    modulus = columns["region.youngs_modulus_Pa"]
    assert modulus.tolist() == [5e3, 5e3, 5e3, 5e3, 40e3, 40e3, 40e3, 40e3]
    assert columns["press"].tolist() == ["top", ""] * 4
    mesh = palpate.TetMesh.read(folder / "box.vtu")
    inside = (np.abs(mesh.nodes[mesh.tets].mean(axis=1)[:, 2] - 0.03) < 0.01).astype(int)
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, inside)
    for row in range(0, 8, 2):
        ratio = columns["material.poissons_ratio"][row]
        materials = {0: palpate.Material(10e3, ratio), 1: palpate.Material(modulus[row], ratio)}
        body = palpate.Body(mesh, material=materials, fixed=lambda p: p[:, 2] < 1e-3)
        whole = palpate.precompute(body, precision="f64", path=folder / "whole.palpate")
        patch = patch_at(whole, (0.04, 0.025, 0.05), 0.012)
        u, force = solve_with_patches(body, [patch], np.array([0, 1e-3, -2e-3]))
        found = [columns[f"force_{axis}_N"][row] for axis in "xyz"]
        assert np.allclose(found, force[0], rtol=1e-6, atol=1e-8)
        assert columns["stiffness_N_per_m"][row] == pytest.approx(force[0] @ [0, 1e-3, -2e-3] / 5e-6, rel=1e-6)
        assert columns["largest_displacement_m"][row] == pytest.approx(
            np.linalg.norm(u[mesh.surface_nodes], axis=1).max(), rel=1e-6
        )
        # The other touch, whose radius follows the body, leaves two components free.
        other = whole.touch((0.02, 0.02, 0.05), (None, None, -1e-3), columns["radius_m"][row + 1])
        assert np.allclose([columns[f"force_{axis}_N"][row + 1] for axis in "xyz"], other.force, rtol=1e-9, atol=1e-11)


def test_a_modulus_that_scales_forces_is_computed_once_and_one_under_loads_each_time(folder, operators):
    grid = '[grid]\nmaterial.youngs_modulus = ["2kPa", "7kPa", 9000]\n'
    columns = Study.read(written(folder, BASE + grid)).run(folder / "out", progress=False).columns
    assert len(operators) == 1
    each = columns["force_N"].reshape(3, 2) / columns["material.youngs_modulus_Pa"].reshape(3, 2)
    assert np.allclose(each, each[0], rtol=1e-12)
    body = palpate.Body(
        palpate.TetMesh.read(folder / "box.vtu"), material=palpate.Material(7e3, 0.3), fixed=lambda p: p[:, 2] < 1e-3
    )
    alone = palpate.precompute(body, precision="f64", path=folder / "a.palpate")
    touch = alone.touch((0.04, 0.025, 0.05), (0, 1e-3, -2e-3), 0.012)
    assert columns["force_N"][2] == pytest.approx(np.linalg.norm(touch.force), rel=1e-9)
    operators.clear()
    loads = "[[loads]]\ngravity = [0, 0, -9.81]\n"
    columns = Study.read(written(folder, BASE + loads + grid)).run(folder / "loaded", progress=False).columns
    assert len(operators) == 3
    assert np.isnan(columns["stiffness_N_per_m"]).all() and (columns["force_N"] > 0).all()


def test_an_interrupted_study_goes_on_and_a_grown_one_computes_what_is_new(folder, operators):
    path, out = written(folder, BASE + REGION + GRID), folder / "out"

    def stop(done, total):
        if done == 2:
            raise KeyboardInterrupt

    whole = Study.read(path).run(folder / "undisturbed", progress=False)
    operators.clear()
    with pytest.raises(KeyboardInterrupt):
        Study.read(path).run(out, progress=stop)
    with (out / "finished.jsonl").open("ab") as torn:
        torn.write(b'{"key": "torn')
    resumed = Study.read(path).run(out, progress=False)
    assert resumed.resumed == 2 and len(operators) == 4
    assert resumed == whole
    grown = Study.read(written(folder, BASE + REGION + GRID.replace("0.45", "0.45, 0.49"))).run(out, progress=False)
    assert grown.resumed == 4 and len(operators) == 6
    old = grown.columns["material.poissons_ratio"] != 0.49
    assert np.array_equal(grown.columns["force_N"][old], whole.columns["force_N"])
    # Another mesh under the same name is another body.
    box_mesh(cells=(6, 4, 4), seed=2).write(folder / "box.vtu")
    assert Study.read(path).run(out, progress=False).resumed == 0


def test_a_body_that_cannot_be_solved_does_not_stop_the_others(folder):
    cases = """
[[case]]
name = "whole"
[[case]]
name = "held nowhere"
supports.fixed = "z < -1"
[[case]]
name = "softer"
material.youngs_modulus = "1kPa"
press.0.point = ["60mm", "25mm", "50mm"]
"""
    path = written(folder, BASE + cases)
    result = run("study", path.name, "--out", "out", cwd=folder)
    assert result.returncode == 2
    assert "case 2: study.toml:7: supports: no node satisfies supports.fixed = 'z < -1'" in result.stderr
    with (folder / "out" / "study.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["whole", "whole", "held nowhere", "softer", "softer"]
    assert rows[2]["force_N"] == "nan" and float(rows[3]["point_x_m"]) == pytest.approx(0.06)
    table = pyarrow.parquet.read_table(folder / "out" / "study.parquet").to_pydict()
    assert [f"{force}" for force in table["force_N"]] == [row["force_N"] for row in rows]
    assert sorted(os.listdir(folder / "out")) == ["finished.jsonl", "study.csv", "study.parquet", "study.png"]
    again = run("study", path.name, "--out", "out", cwd=folder)
    assert "3 bodies, 2 of them known before" in again.stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[grid]\nmaterial.poissons_ratio = [0.3, 0.5]\n",
            r"study.toml:18: material.poissons_ratio: must be less than",
        ),
        ("[grid]\nmaterial.youngs = [1]\n", r"study.toml:18: unknown key 'material.youngs'; did you mean"),
        ("[grid]\nmaterial.poissons_ratio = 0.4\n", r"study.toml:18: grid.material.poissons_ratio: give a list"),
        ("[grid]\ntool.radius = [1]\n", r"study.toml:18: tool.radius: a study varies body, material"),
        (
            "[grid]\npress.radius = [1]\n",
            r"study.toml:18: press.radius: there are 2 tables \[\[press\]\]: write press.0",
        ),
        ("[grid]\npress.2.radius = [1]\n", r"study.toml:18: press.2.radius: the last of the tables \[\[press\]\]"),
        ("[grid]\npress.1.radius = [0.01, -1]\n", r"study.toml:18: press.radius: must be greater than"),
        ('[[case]]\nbody.mesh = "missing.vtu"\n', r"missing.vtu: no such file"),
        ("[[case]]\nbody.model = 'kidney'\n", r"give exactly one of mesh, model and store"),
        ("[dynamics]\ndt = '1ms'\n", r"dynamics"),
        ("[material]\n", r"study.toml: "),
        ("[mesh]\n", r"unknown key 'mesh'"),
        (f"[grid]\nmaterial.density = {list(range(1, 10_002))}\n", r"10001 bodies; a study takes at most"),
    ],
)
def test_mistakes_are_told_with_their_line(text, message, folder):
    with pytest.raises(palpate.Error, match=message) as error:
        Study.read(written(folder, BASE + text))
    assert "\n" not in str(error.value)


def test_presses_that_move_nothing_and_studies_without_presses_are_refused(folder):
    still = BASE.replace('"-", "-", "-1mm"', '"-", 0, 0')
    with pytest.raises(palpate.SceneError, match=r"study.toml:14: press: a press needs a displacement"):
        Study.read(written(folder, still))
    without = BASE[: BASE.index("[[press]]")]
    refused(run("study", written(folder, without).name, cwd=folder), "the key 'press' is missing")
    refused(run("study", "nothing.toml", cwd=folder), "nothing.toml: no such file")


def test_the_example_feels_its_nodule_where_it_is(tmp_path):
    study = Study.read(ROOT / "examples" / "study.toml")
    assert len(study.cases) == 12
    columns = Study(study.path, [study.cases[k] for k in (1, 10)]).run(tmp_path / "out", progress=False).columns
    assert columns["region.youngs_modulus_Pa"].tolist() == [10e3, 10e3, 200e3, 200e3]
    over, beside = columns["stiffness_N_per_m"].reshape(2, 2).T
    assert over[1] > 2.0 * over[0] and beside[0] < beside[1] < 1.1 * beside[0]


def test_the_file_of_the_page_can_be_read(tmp_path):
    text = re.search(r"```toml\n(.*?)```", (ROOT / "docs" / "study.md").read_text(), re.DOTALL)
    for name in ("block.obj", "first.stl", "second.stl"):
        shutil.copy(ROOT / "examples" / "block.obj", tmp_path / name)
    study = Study.read(written(tmp_path, text[1]))
    assert [case.name for case in study.cases] == ["first"] * 9 + ["second"] * 9
    assert study.cases[9].scene.presses[0].point == (0.038, 0.02, 0.047)
    assert study.cases[9].scene.bodies[0].mesh == "second.stl"


def forces_alone(folder, text, *moduli):
    """Force of the first press of each body by the scene alone."""
    found = []
    for modulus in moduli:
        own = text.replace("MODULUS", modulus).split("[[press]]")[0]
        scene = palpate.Scene.read(written(folder, own, "alone.toml"))
        green = scene.build(progress=False).bodies[0].green
        found.append(np.linalg.norm(green.touch((0.04, 0.025, 0.05), (0, 1e-3, -2e-3), 0.012).force))
    return found


@pytest.mark.parametrize("what", ["constants of a region", "constants of the material"])
def test_a_modulus_that_does_not_scale_all_is_solved_each_time(folder, operators, what):
    body = BASE.replace('"10kPa"', '"MODULUS"')
    if what == "constants of a region":
        region = REGION + 'law = "yeoh"\nc10 = "6kPa"\n'
        body, grid = body.replace("[[press]]", region + "[[press]]", 1), "material.youngs_modulus"
    else:
        constants = 'law = "yeoh"\nc10 = "MODULUS"\n'
        body, grid = body.replace('youngs_modulus = "MODULUS"\n', constants), "material.c10"
    values = ("2kPa", "8kPa")
    text = body.replace("MODULUS", values[0]) + f"[grid]\n{grid} = {list(values)}\n"
    columns = Study.read(written(folder, text)).run(folder / "out", progress=False).columns
    assert np.allclose(columns["force_N"][::2], forces_alone(folder, body, *values), rtol=1e-4)
    assert len(operators) == 2


@pytest.mark.slow
def test_parts_of_a_surface_are_bodies_of_their_own(folder):
    parts = [trimesh.creation.icosphere(2, 20.0), trimesh.creation.icosphere(2, 12.0)]
    parts[1].apply_translation([60.0, 0.0, 0.0])
    trimesh.util.concatenate(parts).export(folder / "two.stl")
    mesh = 'mesh = "two.stl"\nunit = "mm"\nmax_element_size = "8mm"'
    press = '[[press]]\npoint = ["60mm", 0, "12mm"]\ndisplacement = ["-", "-", "-1mm"]\nradius = "3mm"\n'
    cases = "".join(f"[[case]]\nbody.part = {part}\n" for part in (1, 2))
    text = BASE.replace('mesh = "box.vtu"', mesh).split("[[press]]")[0] + press + cases
    result = Study.read(written(folder, text)).run(folder / "out", progress=False)
    # The press meets the second part alone.
    assert list(result.problems) == [1]
    assert result.columns["volume_m3"][1] == pytest.approx(4 / 3 * np.pi * 0.012**3, rel=0.1)


def test_nodes_of_a_file_that_is_edited_are_solved_again(folder):
    mesh = palpate.TetMesh.read(folder / "box.vtu")
    held = np.flatnonzero(mesh.nodes[:, 2] < 1e-3)
    text = BASE.replace('"z < min + 1mm"', '"held.nodes"') + '[grid]\nmaterial.youngs_modulus = ["2kPa"]\n'
    forces = []
    for nodes in (held, held[: len(held) // 2]):
        (folder / "held.nodes").write_text(" ".join(map(str, nodes)))
        result = Study.read(written(folder, text)).run(folder / "out", progress=False)
        assert result.resumed == 0
        forces.append(result.columns["force_N"][0])
    assert forces[1] < 0.95 * forces[0]


def test_a_line_of_answers_that_is_none_is_left_out(folder):
    path, out = written(folder, BASE), folder / "out"
    Study.read(path).run(out, progress=False)
    with (out / "finished.jsonl").open("ab") as kept:
        kept.write(b"[1, 2]\n7\n")
    assert Study.read(path).run(out, progress=False).resumed == 1
