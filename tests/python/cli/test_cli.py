"""The command line as a user meets it: real files, and mistakes that cost one line."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command_line import refused, run, run_process
from conftest import box_mesh

import palpate


@pytest.fixture
def ball(tmp_path):
    shape = trimesh.creation.icosphere(subdivisions=3, radius=40.0)
    shape.export(tmp_path / "ball.stl")
    return shape


def test_surface_to_force(ball, tmp_path):
    result = run("mesh", "ball.stl", "ball.vtu", "--unit", "mm", "--max-size", "8mm", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    mesh = palpate.TetMesh.read(tmp_path / "ball.vtu")
    assert mesh.volume == pytest.approx(ball.volume * 1e-9, rel=0.03)
    make = ("precompute", "ball.vtu", "--fix", "z < min + 15mm", "-E", "10kPa", "--nu", "0.4", "-o", "ball.palpate")
    result = run(*make, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert sorted(os.listdir(tmp_path)) == ["ball.palpate", "ball.stl", "ball.vtu"]
    press = ("touch", "ball.palpate", "--point", "0,0,4cm", "--press", "0,0,-2mm", "--radius", "8mm")
    result = run(*press, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    force = palpate.GreensFunction.load(tmp_path / "ball.palpate").touch((0, 0, 0.04), (0, 0, -2e-3), 8e-3).force
    assert force[2] < 0
    assert f"{np.linalg.norm(force):.5g} N" in result.stdout
    assert "surface nodes touchable" in run("info", "ball.palpate", cwd=tmp_path).stdout
    assert "tetrahedra" in run("info", "ball.vtu", cwd=tmp_path).stdout


@pytest.fixture
def box(tmp_path):
    """Tetrahedra of 80 x 50 x 50 mm: no mesher has to be waited for."""
    mesh = box_mesh()
    mesh.write(tmp_path / "box.vtu", unit="mm")
    return mesh


def test_cache_is_listed_and_cleared(box, tmp_path):
    run("precompute", "box.vtu", "--unit", "mm", "--fix", "z < 1mm", cwd=tmp_path)
    assert "1 file, " in run("cache", "list", cwd=tmp_path).stdout
    assert "deleted 1 file, " in run("cache", "clear", cwd=tmp_path).stdout
    assert "0 files" in run("cache", "list", cwd=tmp_path).stdout


def broken_surfaces(folder):
    cube = trimesh.creation.box(extents=(50, 50, 50)).subdivide()
    (folder / "empty.stl").write_bytes(b"")
    (folder / "garbage.stl").write_bytes(bytes(range(256)) * 8)
    spiked = cube.copy()
    spiked.vertices[5] = np.nan
    spiked.export(folder / "nan.obj")
    sheet = cube.copy()
    sheet.update_faces(sheet.triangles_center[:, 2] > 24.9)
    sheet.export(folder / "sheet.stl")


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("missing.stl", ["missing.stl", "no such file"]),
        ("empty.stl", ["empty.stl", "empty"]),
        ("garbage.stl", ["garbage.stl"]),
        ("nan.obj", ["nan.obj", "not finite"]),
        ("sheet.stl", ["encloses nothing", "no inside"]),
    ],
)
def test_broken_surfaces_cost_one_line_and_leave_nothing(tmp_path, file, words):
    broken_surfaces(tmp_path)
    before = sorted(os.listdir(tmp_path))
    refused(run("mesh", file, "out.vtu", "--unit", "mm", cwd=tmp_path), *words)
    assert sorted(os.listdir(tmp_path)) == before


def test_inverted_surface_is_turned_with_a_notice(tmp_path):
    cube = trimesh.creation.box(extents=(50, 50, 50)).subdivide()
    cube.invert()
    cube.export(tmp_path / "inverted.stl")
    result = run("mesh", "inverted.stl", "out.vtu", "--unit", "mm", "--max-size", "2cm", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "turned round" in result.stderr
    assert palpate.TetMesh.read(tmp_path / "out.vtu").volume == pytest.approx(0.05**3, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--unit", "mm", "--fix", "z > 9"], ["no node satisfies", "z > 9"]),
        (["--unit", "mm", "--fix", "z > -9"], ["every node is fixed"]),
        (["--unit", "mm", "--fix", "open('x')"], ["not allowed"]),
        (["--unit", "parsec", "--fix", "z < 1mm"], ["unknown length unit 'parsec'", "mm"]),
        (["--unit", "mm", "--fix", "z < 1mm", "-E", "10kilo"], ["unknown unit 'kilo'"]),
        (["--unit", "mm", "--fix", "z < 1mm", "-E", "0"], ["Young's modulus must be positive"]),
        (["--unit", "mm", "--fix", "z < 1mm", "--nu", "0.5"], ["Poisson's ratio", "0.5"]),
        (["--unit", "mm", "--fix", "z < 1mm", "--precision", "f12"], ["unknown precision 'f12'"]),
    ],
)
def test_wrong_options_cost_one_line_and_leave_nothing(box, tmp_path, options, words):
    refused(run("precompute", "box.vtu", "-o", "box.palpate", *options, cwd=tmp_path), *words)
    assert os.listdir(tmp_path) == ["box.vtu"]


def test_scripted_press_leaves_a_log_and_a_plot(tmp_path, shared_cache):
    for name in ("block.toml", "block.obj"):
        shutil.copy(Path(__file__).parents[3] / "examples" / name, tmp_path)
    result = run("run", "block.toml", "--headless", "1.5", "--out", "results", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert sorted(os.listdir(tmp_path / "results")) == ["block.csv", "block.png"]
    log = np.genfromtxt(tmp_path / "results" / "block.csv", delimiter=",", names=True)
    assert log["fz_N"].max() > 0.1
    assert log["fz_N"][[0, -1]] == pytest.approx(0)
    assert np.median(np.diff(log["time_s"])) == pytest.approx(1e-3, rel=1e-6)
    assert (tmp_path / "results" / "block.png").read_bytes().startswith(b"\x89PNG")
    assert "largest strain" in result.stdout and "accurate" not in result.stdout


@pytest.mark.slow
def test_scripted_press_is_limited_or_flagged(tmp_path, shared_cache):
    scene = '[body]\nmodel = "kidney"\npaper = true\n[tool]\ncontact = "patch"\n'
    (tmp_path / "limited.toml").write_text(scene + "[view]\nstrain_limit = 0.1\n")
    (tmp_path / "free.toml").write_text(scene + "[view]\nstrain_limit = 0\n")
    limited = run("run", "limited.toml", "--headless", "1", cwd=tmp_path).stdout
    assert "largest strain 10.0 %, where the tool was limited" in limited and "accurate" not in limited
    free = run("run", "free.toml", "--headless", "1", cwd=tmp_path).stdout
    assert "estimated error of the force" in free and "limited" not in free
    (tmp_path / "linear.toml").write_text(f'{scene}[material]\nlaw = "linear"\n[view]\nstrain_limit = 0\n')
    linear = run("run", "linear.toml", "--headless", "1", cwd=tmp_path).stdout
    assert "beyond 10 %, where linear elasticity is no longer accurate" in linear and "estimated" not in linear


def test_wrong_scene_costs_one_line(tmp_path):
    (tmp_path / "a.toml").write_text("[body]\nmsh = 'a.stl'\n[supports]\nfixed = 'z < 0'\n")
    refused(run("run", "a.toml", cwd=tmp_path), "a.toml:2", "body.msh", "did you mean 'mesh'")


def test_damaged_store_costs_one_line(tmp_path):
    (tmp_path / "bad.palpate").write_bytes(b"not a store at all")
    refused(run("info", "bad.palpate", cwd=tmp_path), "bad.palpate", "not a Palpate store")


def test_demo_of_a_model_without_a_browser(tmp_path, shared_cache):
    result = run("demo", "kidney", "--paper", "--headless", "1", "--out", "results", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert sorted(os.listdir(tmp_path / "results")) == ["kidney-paper.csv", "kidney-paper.png"]
    log = np.genfromtxt(tmp_path / "results" / "kidney-paper.csv", delimiter=",", names=True)
    assert log["fz_N"].max() > 0.05  # the body pushes the tool, which comes from above, upwards
    refused(run("demo", "spleen", cwd=tmp_path), "no model 'spleen'", "doll, kidney, liver, beam")


def test_models_beside_the_counts_of_the_paper(tmp_path):
    shown = run_process("models", cwd=tmp_path, env={**os.environ, "COLUMNS": "100"}).stdout
    for count in ("1686", "5430", "2803", "572"):  # table 1 of the paper
        assert count in shown


def test_info_on_a_scene(block_green, tmp_path):
    (tmp_path / "a.toml").write_text('[body]\nmodel = "liver"\n[material]\nyoungs_modulus = "5kPa"\n')
    shown = run("info", "a.toml", cwd=tmp_path).stdout
    assert "  material.youngs_modulus = 5000.0\n" in shown and "  body.model = liver\n" in shown
    (tmp_path / "s.toml").write_text(f'[body]\nstore = "{block_green.path}"\n')
    shown = run("info", "s.toml", cwd=tmp_path).stdout
    # The store's material, not the default of scenes.
    assert "  body.material.poissons_ratio = 0.4\n" in shown and "law" not in shown and "0.45" not in shown
    several = '[[body]]\nmodel = "liver"\n[[body]]\nmodel = "kidney"\n[body.material]\nyoungs_modulus = "5kPa"\n'
    (tmp_path / "b.toml").write_text(several)
    shown = run("info", "b.toml", cwd=tmp_path).stdout
    assert "  body[0].model = liver\n" in shown and "  body[1].material.youngs_modulus = 5000.0\n" in shown


def test_wrong_words_are_explained(tmp_path):
    for arguments, word in (
        (["presurize"], "presurize"),
        (["mesh", "--unit"], "unit"),
        (["run", "--prot", "1"], "prot"),
    ):
        result = run(*arguments, cwd=tmp_path)
        assert result.returncode == 2
        assert word in result.stderr
        assert "Traceback" not in result.stderr


def test_precompute_with_gravity_and_a_locking_material(box, tmp_path):
    """A sagging store says what it carries; locking is warned of in one line."""
    options = ("--unit", "mm", "--fix", "z < 1mm", "--nu", "0.48", "--density", "1.2g/cm3", "--gravity", "0,0,-9.81")
    result = run("precompute", "box.vtu", *options, "-o", "box.palpate", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, lines
    assert "warning: volumetric locking: 4-node tetrahedra" in lines[0]
    green = palpate.GreensFunction.load(tmp_path / "box.palpate")
    assert green.free_displacements[:, 2].min() < -1e-4
    weight = 1200 * 9.81 * 0.08 * 0.05 * 0.05
    assert green.description["load_N"][2] == pytest.approx(-weight, rel=1e-6)
    refused(run("precompute", "box.vtu", "--fix", "z<0", "--gravity", "0,1", cwd=tmp_path), "gravity", "three numbers")


def test_impulse_demo_writes_the_history_of_the_struck_node(tmp_path, shared_cache):
    result = run("demo", "beam", "--paper", "--impulse", "--headless", "0.5", "--out", "results", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert sorted(os.listdir(tmp_path / "results")) == ["beam-paper-impulse.csv", "beam-paper-impulse.png"]
    table = np.genfromtxt(tmp_path / "results" / "beam-paper-impulse.csv", delimiter=",", names=True)
    assert len(table) == 501
    # 10 N at the end of one step and none after it: an impulse of 0.01 N s.
    assert np.trapezoid(table["fz_N"], table["time_s"]) == pytest.approx(0.01)
    swing = table["uz_m"]
    assert swing.max() > 1e-3 > -1e-3 > swing.min()
    assert abs(table["uy_m"]).max() < 0.5 * abs(swing).max()
    assert "10 N along z for 1 ms" in result.stdout
    refused(run("demo", "teapot", "--impulse", cwd=tmp_path), "teapot", "beam")
