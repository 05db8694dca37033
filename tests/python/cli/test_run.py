"""``palpate run`` on files of all kinds, and what the other commands say of surfaces."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command_line import refused, run
from conftest import box_mesh
from typer.testing import CliRunner

import palpate
from palpate.cli import app as command_line
from palpate.cli.bodies import likely_units
from palpate.cli.run_file import RunOptions, built_from
from palpate.models import NAMES
from palpate.scene import Scene
from palpate.scene.sizes import default_contact_radius, default_radius
from palpate.validation.verify import BENCHMARKS

BLOCK = Path(__file__).parents[3] / "examples" / "block.obj"


@pytest.mark.slow
def test_a_bare_surface_runs_with_defaults_that_are_told(tmp_path):
    shutil.copy(BLOCK, tmp_path)
    result = run("run", "block.obj", "--headless", "1", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    computed, series, text, *_ = result.stdout.splitlines()
    assert series.startswith("series beyond small strain below spheres of 5 mm")
    # The size is printed before it is written.
    assert computed.startswith("computing 2526 columns: at most 51 MB in the cache")
    assert computed.endswith(", 842 on the surface)")
    for word in (
        "80 x 50 x 50 mm",
        "unit mm (--unit; it may also be cm or in)",
        "z < min + 0.25mm (--fix)",
        "E = 10kPa (-E)",
        "law neo-hookean",
        "0.45 (--nu)",
    ):
        assert word in text
    assert "tool of radius 5 mm (--radius)" in text
    log = np.genfromtxt(tmp_path / "block.csv", delimiter=",", names=True)
    assert log["fz_N"].max() > 0.05


@pytest.mark.parametrize("growing", [None, {}])
def test_the_size_of_a_scene_is_printed_before_it_is_computed(capsys, monkeypatch, tmp_path, growing):
    box_mesh().write(tmp_path / "box.vtu", unit="m")
    (tmp_path / "a.toml").write_text('[body]\nmesh = "box.vtu"\nunit = "m"\n[supports]\nfixed = "z < min + 1mm"\n')

    def stop(*_, **__):
        raise palpate.Error("computing now")

    with monkeypatch.context() as patch:
        patch.setattr("palpate.scene.build.precompute", stop)
        with pytest.raises(palpate.Error, match="computing now"):
            built_from(tmp_path / "a.toml", RunOptions(), growing)
    mesh = palpate.TetMesh.read(tmp_path / "box.vtu", "m")
    counts = f"({len(mesh.nodes)} nodes, {len(mesh.surface_nodes)} on the surface)"
    line, series = capsys.readouterr().out.strip().splitlines()
    assert line.startswith(f"computing {3 * len(mesh.surface_nodes)} columns: at most ") and line.endswith(counts)
    assert re.fullmatch(r"series beyond small strain below spheres of 5 mm: \d+ places, .* MB, time about .*", series)
    # The second time its store is there.
    for printed in (True, False):
        built_from(tmp_path / "a.toml", RunOptions(), growing)
        assert ("computing" in capsys.readouterr().out) is printed


@pytest.mark.slow
def test_options_of_a_bare_surface_are_those_of_a_scene(capsys, tmp_path):
    options = RunOptions("8mm", "z < min + 1mm", "20kPa", 0.4, "mm", density="900kg/m3", max_size="2cm")
    built = built_from(BLOCK, options)
    # No option chooses it.
    assert capsys.readouterr().out.endswith("; by default law neo-hookean (a scene may name another)\n")
    (tmp_path / "a.toml").write_text(
        f'[body]\nmesh = "{BLOCK}"\nunit = "mm"\nmax_element_size = "2cm"\n[supports]\nfixed = "z < min + 1mm"\n'
        '[material]\nyoungs_modulus = "20kPa"\npoissons_ratio = 0.4\ndensity = 900\n[tool]\nradius = "8mm"\n'
    )
    scene = palpate.Scene.read(tmp_path / "a.toml").build(progress=False)
    assert built.bodies[0].green.key == scene.bodies[0].green.key
    assert built.scene.tools == scene.scene.tools


def test_a_bare_volume_mesh_runs_too(capsys, tmp_path):
    box_mesh().write(tmp_path / "box.vtu", unit="mm")
    built = built_from(tmp_path / "box.vtu", RunOptions())
    printed = capsys.readouterr().out
    assert "unit mm (--unit;" in printed and "law neo-hookean" in printed
    # As of a scene without [material].
    assert built.bodies[0].body.material.law == built.scene.material.law == Scene(body={"model": "beam"}).material.law
    assert "series beyond small strain below spheres of 5 mm" in printed
    assert built.bodies[0].body.mesh.volume == pytest.approx(0.08 * 0.05 * 0.05)
    with pytest.raises(palpate.MeshError, match="--part, --max-volume-loss and --segment are for files"):
        built_from(tmp_path / "box.vtu", RunOptions(part="all"))


def test_options_stand_instead_of_what_a_scene_says(tmp_path):
    (tmp_path / "a.toml").write_text(
        '[[body]]\nmodel = "beam"\npaper = true\n[body.material]\nyoungs_modulus = "5kPa"\npoissons_ratio = 0.3\n'
        '[supports]\nfixed = "x < 1mm"\n[[tool]]\nradius = "4mm"\n[[tool]]\ncontact = "patch"\n'
    )
    changed = built_from(tmp_path / "a.toml", RunOptions("7mm", "x < 3mm", "20kPa"))
    material = changed.bodies[0].body.material[0]
    assert (material.youngs_modulus, material.poissons_ratio) == (20e3, 0.3)
    assert [tool.radius for tool in changed.scene.tools] == [7e-3, 7e-3]
    assert changed.scene.tools[1].contact_radius == 7e-3 and changed.scene.tools[0].contact == "local"
    as_written = built_from(tmp_path / "a.toml", RunOptions())
    assert len(changed.bodies[0].green.fixed_nodes) >= len(as_written.bodies[0].green.fixed_nodes)
    assert as_written.bodies[0].body.material[0].youngs_modulus == 5e3


def test_options_that_a_file_does_not_take_are_refused_by_name(block_green):
    with pytest.raises(palpate.SceneError, match=r"-E is not for this file: .*palpate precompute"):
        built_from(block_green.path, RunOptions(youngs_modulus="5kPa"))
    with pytest.raises(palpate.SceneError, match="--unit is not for this file: it stands in the table"):
        built_from(BLOCK.parent / "block.toml", RunOptions(unit="mm"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"youngs_modulus": "10kilo"}, "-E: unknown unit 'kilo'"),
        ({"youngs_modulus": "-1kPa"}, "-E: must be greater than 0"),
        ({"poissons_ratio": 0.7}, "--nu: must be less than 0.5"),
        ({"radius": "0mm"}, "--radius must be positive"),
        ({"radius": "wide"}, "'wide' is not a length"),
        ({"fix": "z <"}, "cannot read the predicate 'z <'"),
    ],
)
def test_wrong_options_are_refused_by_name_for_scenes_and_bare_files(options, message, tmp_path):
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\npaper = true\n')
    with pytest.raises(palpate.Error, match=message):
        built_from(tmp_path / "a.toml", RunOptions(**options))
    box_mesh().write(tmp_path / "box.vtu")
    with pytest.raises(palpate.Error):
        built_from(tmp_path / "box.vtu", RunOptions(**options))


def test_a_tool_larger_than_the_body_is_refused_before_columns_are_computed(block_green, monkeypatch, tmp_path):
    def compute(*_, **__):
        raise AssertionError("computing")

    for place in ("palpate.scene.build.precompute", "palpate.cli.run_file.precompute"):
        monkeypatch.setattr(place, compute)
    box_mesh().write(tmp_path / "box.vtu", unit="m")
    trimesh.creation.box((0.08, 0.05, 0.05)).export(tmp_path / "box.stl")
    sources = ('mesh = "box.vtu"\nunit = "m"', 'mesh = "box.stl"\nunit = "m"', f'store = "{block_green.path}"')
    for number, source in enumerate(sources):
        supports = "" if "store" in source else '[supports]\nfixed = "z < min + 1mm"\n'
        (tmp_path / "a.toml").write_text(f"[body]\n{source}\n{supports}[tool]\nradius = 6\n")
        line = (tmp_path / "a.toml").read_text().count("\n")
        words = (f"a.toml:{line}: tool.radius is 6 m, more than the longest side of the bodies, 80 mm",)
        refused(run("info", "a.toml", cwd=tmp_path), *words)
        if number != 1:
            refused(run("run", "a.toml", "--headless", "1", cwd=tmp_path), *words)
    with pytest.raises(palpate.SceneError, match="radius is 6 m, more than the longest side"):
        built_from(tmp_path / "box.vtu", RunOptions(radius="6m", unit="m"))


def test_radii_that_are_not_given_follow_the_body(block_green):
    assert default_radius(block_green) == pytest.approx(0.08 / 16)
    built = built_from(block_green.path, RunOptions())
    assert built.scene.tools[0].radius == built.scene.tools[0].contact_radius == pytest.approx(0.005)
    assert built_from(block_green.path, RunOptions("3mm")).scene.tools[0].radius == 0.003


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    """A plate of 451 nodes a face: a sixteenth of its longest side covers few of them, half of it too many."""
    mesh = box_mesh(cells=(40, 10, 1), size=(0.08, 0.02, 0.01), jitter=0)
    body = palpate.Body(mesh, material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9)
    return palpate.precompute(body, precision="f16", path=tmp_path_factory.mktemp("fine") / "fine.palpate")


def test_a_radius_that_covers_too_many_nodes_is_refused_with_the_largest(fine, tmp_path):
    largest = fine.largest_contact_radius(0.04)
    assert default_contact_radius(fine) == default_radius(fine) == pytest.approx(0.005) and largest < 0.03
    fine.touch((0.04, 0.01, 0.01), (0, 0, -1e-4), 0.99 * largest)
    with pytest.raises(palpate.BodyError, match=rf"of 40 mm .* at most {1e3 * largest:.3g} mm \(--radius\)"):
        fine.touch((0.04, 0.01, 0.01), (0, 0, -1e-4), 0.04)
    (tmp_path / "a.toml").write_text(f'[body]\nstore = "{fine.path}"\n[tool]\ncontact_radius = "4cm"\n')
    with pytest.raises(palpate.SceneError, match=r"tool\.contact_radius = 40 mm covers .* at most"):
        palpate.Scene.read(tmp_path / "a.toml").build()
    press = ("touch", fine.path, "--point", "4cm,1cm,1cm", "--press=-,-,-0.1mm")
    result = run(*press, cwd=tmp_path)
    assert result.returncode == 0 and "contact radius: 5 mm, by default; --radius changes it" in result.stdout
    refused(run(*press, "--radius", "4cm", cwd=tmp_path), "at most", "--radius")


@pytest.mark.slow
def test_a_fine_surface_takes_what_it_can():
    """Of a mesh so fine in its middle that a sixteenth covers too many nodes the radius of patches is what fits."""
    import skfem

    along = np.concatenate([[0, 0.01, 0.02, 0.03], np.linspace(0.035, 0.045, 21), [0.05, 0.06, 0.07, 0.08]])
    result = skfem.MeshTet.init_tensor(along, np.linspace(0, 0.01, 21), np.array([0, 0.002]))
    mesh = palpate.TetMesh(result.p.T, result.t.T)
    body = palpate.Body(mesh, material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9)
    green = palpate.precompute(body, precision="f16")
    built = palpate.scene.BuiltScene.of(palpate.Scene(body={"store": "x.palpate"}), body, green)
    assert default_contact_radius(green) < default_radius(green)
    assert built.scene.tools[0].contact_radius == default_contact_radius(green)
    palpate.Simulation(built)


@pytest.mark.parametrize(
    ("longest", "unit"), [(0.2, "m"), (2.9, "m"), (80.0, "mm"), (2000.0, "mm"), (90_000.0, "um"), (1e12, "m")]
)
def test_the_unit_of_a_bare_file_is_the_most_common_that_fits_a_body(longest, unit, tmp_path):
    trimesh.creation.box((longest, 0.4 * longest, 0.3 * longest)).export(tmp_path / "box.stl")
    assert likely_units(tmp_path / "box.stl")[0] == unit


def test_info_reads_surfaces(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=40.0)
    ball.export(tmp_path / "ball.ply")
    text = run("info", "ball.ply", cwd=tmp_path).stdout
    assert f"{len(ball.vertices)} vertices, {len(ball.faces)} triangles" in text
    assert "80 x 80 x 80 mm if its unit is mm" in text and f"closed, volume {1e-3 * ball.volume:.4g} cm3" in text
    assert "palpate mesh ball.ply ball.vtu --unit mm" in text
    ball.update_faces(np.arange(len(ball.faces)) > 0)
    ball.export(tmp_path / "open.glb")
    text = run("info", "open.glb", "--unit", "cm", cwd=tmp_path).stdout
    assert "800 x 800 x 800 mm if its unit is cm" in text
    assert "not closed: 3 open edges; what it encloses is filled all the same" in text
    assert "palpate mesh open.glb open.vtu --unit cm" in text


def test_version():
    result = CliRunner().invoke(command_line.app, ["--version"])
    assert result.exit_code == 0 and result.output.strip() == f"palpate {palpate.__version__}"


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("demo ", NAMES),
        ("demo k", ("kidney",)),
        ("verify c", tuple(name for name in BENCHMARKS if name.startswith("c"))),
        ("mesh a.stl b.vtu --unit ", ("m", "cm", "mm", "um", "in")),
        ("run a.stl --unit c", ("cm",)),
        ("precompute a.vtu --precision ", ("f16", "f32", "f64")),
    ],
)
def test_the_shell_completes_models_checks_and_units(words, offered):
    given = f"palpate {words}"
    count = len(given.split()) - (0 if given.endswith(" ") else 1)
    environment = {"_PALPATE_COMPLETE": "complete_bash", "COMP_WORDS": given, "COMP_CWORD": str(count)}
    result = CliRunner().invoke(command_line.app, [], env=environment, prog_name="palpate")
    assert set(offered) <= set(result.output.split())


@pytest.mark.slow
def test_a_slender_rod_held_at_one_end_is_noted(tmp_path):
    box_mesh((12, 2, 2), (0.4, 0.02, 0.02)).to_quadratic().write(tmp_path / "rod.vtu")
    held = run(
        "run", "rod.vtu", "--unit", "m", "--fix", "x < 1mm", "--radius", "8mm", "--headless", "0.2", cwd=tmp_path
    )
    assert held.returncode == 0, held.stderr
    assert "is held loosely" in held.stderr
