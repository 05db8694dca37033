"""Scene files: mistakes are named with their line."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate

GOOD = """\
[body]
mesh = "block.vtu"
unit = "mm"

[material]
youngs_modulus = "10kPa"
poissons_ratio = 0.45

[supports]
fixed = "z < 1mm"

[tool]
radius = "5mm"
"""


def test_quantities_are_si(tmp_path):
    (tmp_path / "a.toml").write_text(GOOD)
    scene = palpate.Scene.read(tmp_path / "a.toml")
    assert scene.material.youngs_modulus == 10e3
    assert scene.tools[0].radius == pytest.approx(5e-3)
    assert scene.device.max_force > 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("youngs_modulus", "young_modulus", r"a\.toml:6: unknown key 'material.young_modulus'; did you mean 'youngs_"),
        ("[tool]", "[tol]", r"a\.toml:12: unknown key 'tol'; did you mean 'tool'"),
        ('"10kPa"', '"10 kilo"', r"a\.toml:6: material.youngs_modulus: unknown unit 'kilo'"),
        ("0.45", "0.5", r"a\.toml:7: material.poissons_ratio: .*less than 0.5"),
        ('"5mm"', '"-5mm"', r"a\.toml:13: tool.radius: .*greater than 0"),
        ('fixed = "z < 1mm"', "", r"a\.toml:9: the key 'supports.fixed' is missing"),
        ('unit = "mm"', "unit = ", r"a\.toml: .*line 3"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path, old, new, message):
    (tmp_path / "a.toml").write_text(GOOD.replace(old, new))
    with pytest.raises(palpate.SceneError, match=message):
        palpate.Scene.read(tmp_path / "a.toml")


def test_missing_scene_and_missing_mesh(tmp_path):
    with pytest.raises(palpate.SceneError, match="no such file"):
        palpate.Scene.read(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_text(GOOD)
    with pytest.raises(palpate.MeshError, match=r"block\.vtu: no such file"):
        palpate.Scene.read(tmp_path / "a.toml").build()


def test_models_stores_and_views(tmp_path):
    text = '[body]\nmodel = "kidney"\npaper = true\n[view]\nposition = [0.0, -0.3, 0.1]\ntarget = [0, 0, 0.05]\n'
    (tmp_path / "a.toml").write_text(text)
    scene = palpate.Scene.read(tmp_path / "a.toml")
    assert scene.name == "kidney"
    assert scene.view.position == (0, -0.3, 0.1)
    green = scene.build(progress=False).bodies[0].green
    green.save(tmp_path / "k.palpate")
    (tmp_path / "b.toml").write_text('[body]\nstore = "k.palpate"\n[tool]\nradius = "3mm"\n')
    built = palpate.Scene.read(tmp_path / "b.toml").build()
    assert built.bodies[0].body is None
    assert built.bodies[0].green.key == green.key


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[body]\nmodel = "kidny"', r"a\.toml:1: body: unknown model 'kidny'; there are doll, kidney"),
        ('[body]\nmodel = "doll"\nmesh = "a.vtu"', r"a\.toml:1: body: give exactly one of mesh, model and store"),
        ("[body]\nunit = 'mm'", r"a\.toml:1: body: give exactly one of"),
        ('[body]\nstore = "a"\n[supports]\nfixed = "z < 0"', "has its own material, supports, loads"),
        (
            '[body]\nmodel = "doll"\n[view]\ntarget = [0, 0]',
            r"a\.toml:4: view.target.* has too few entries",
        ),
        ('[body]\nmodel = "doll"\n[view]\nfrom = [0, 0, 1]', r"a\.toml:4: unknown key 'view.from'; known are position"),
        ("", r"a\.toml: the file is empty"),
    ],
)
def test_mistakes_in_models_stores_and_views(tmp_path, text, message):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(palpate.SceneError, match=message):
        palpate.Scene.read(tmp_path / "a.toml")


def test_predicate_that_fixes_nothing_says_where_the_body_is(tmp_path):
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\npaper = true\n[supports]\nfixed = "x > 1km"\n')
    with pytest.raises(palpate.Error, match="km"):
        palpate.Scene.read(tmp_path / "a.toml").build()
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\npaper = true\n[supports]\nfixed = "x > 1m"\n')
    with pytest.raises(palpate.SceneError, match=r"supports.fixed = 'x > 1m': the body reaches from .* to .* m"):
        palpate.Scene.read(tmp_path / "a.toml").build()


REGIONS = """\
[body]
mesh = "block.msh"
precision = "f64"

[material]
youngs_modulus = "5kPa"
density = 900

[[region]]
mesh_region = "core"
youngs_modulus = "20kPa"

[[region]]
shape = "sphere"
center = ["4cm", "25mm", 0.05]
radius = "15mm"
poissons_ratio = 0.3

[supports]
fixed = "z < 1e-6"

[[loads]]
gravity = [0, 0, -9.81]

[[loads]]
pressure = "200Pa"
on = "x > max - 1e-6"

[[loads]]
force = ["0.2N", 0, 0]
on = "z > max - 1e-6"

[[loads]]
force = [0, "50mN", 0]
nodes = [7, 8]
"""


@pytest.fixture
def regions_scene(tmp_path):
    mesh = box_mesh(cells=(8, 5, 5)).with_regions({"core": palpate.shapes.Box((0.02, -1, -1), (0.06, 1, 1))})
    mesh.write(tmp_path / "block.msh")
    (tmp_path / "a.toml").write_text(REGIONS)
    return tmp_path / "a.toml"


def test_regions_and_loads_of_a_scene(regions_scene):
    body = palpate.Scene.read(regions_scene).build().bodies[0].body
    mesh = body.mesh
    centroids = mesh.nodes[mesh.tets].mean(axis=1)
    core = (centroids[:, 0] > 0.02) & (centroids[:, 0] < 0.06)
    ball = np.linalg.norm(centroids - [0.04, 0.025, 0.05], axis=1) < 0.015
    expected = np.tile([5e3, 0.45, 900.0], (len(mesh.tets), 1))
    expected[core, 0] = 20e3
    expected[ball] = [5e3, 0.3, 900.0]  # the later table wins, and takes the rest from [material]
    assert np.array_equal(body.element_materials, expected)
    assert 0 < ball.sum() < core.sum() < len(mesh.tets)
    area = 0.05 * 0.05
    total = np.array([-200 * area + 0.2, 2 * 0.05, -9.81 * 900 * mesh.volume])
    assert body.load_vector().sum(axis=0) == pytest.approx(total, rel=1e-9)
    assert body.load_vector()[7, 1] == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('mesh_region = "core"', 'mesh_region = "coer"', r"a\.toml:9: region: the mesh has no region coer; .* core"),
        ('"15mm"', '"15kg"', r"a\.toml:16: region.radius: unknown unit 'kg'"),
        ('radius = "15mm"\n', "", r"a\.toml:13: region: a sphere needs center and radius: 'radius' is missing"),
        ('"sphere"', '"ball"', r"a\.toml:14: region.shape: .*'sphere'.* got 'ball'"),
        ('radius = "15mm"', 'radius = "15mm"\nnormal = [0, 0, 1]', r"a\.toml:13: region: 'normal' does not belong to"),
        ('"4cm", ', "", r"a\.toml:15: region.center has too few entries"),
        ('["4cm"', '["4m"', r"a\.toml:13: region: no element has its centroid in the sphere"),
        ("poissons_ratio = 0.3", "poissons_ratio = 0.5", r"a\.toml:17: region.poissons_ratio: .*less than 0.5"),
        ("mesh_region =", "mesh_regoin =", r"a\.toml:10: unknown key 'region.mesh_regoin'; did you mean 'mesh_region'"),
        ("[0, 0, -9.81]", "[0, 0]", r"a\.toml:23: loads.gravity has too few entries: it needs 3, got 2"),
        ('"200Pa"', '"200N"', r"a\.toml:26: loads.pressure: unknown unit 'N'"),
        ('on = "x > max - 1e-6"', 'on = "x > max + 1"', r"a\.toml:25: loads: pressure: no face of the surface"),
        ('on = "x > max - 1e-6"', 'on = "x >"', r"a\.toml:25: loads: cannot read the predicate"),
        ("nodes = [7, 8]", "nodes = [7, 10000]", r"a\.toml:33: loads: forces node 10000 does not exist"),
        ("nodes = [7, 8]", "", r"a\.toml:33: loads: a force is spread"),
        ('"0.2N"', "nan", r"a\.toml:30: loads.force: .*finite"),
    ],
)
def test_mistakes_in_regions_and_loads_are_named_with_their_line(regions_scene, old, new, message):
    assert REGIONS.count(old) == 1
    regions_scene.write_text(REGIONS.replace(old, new))
    with pytest.raises(palpate.SceneError, match=message):
        palpate.Scene.read(regions_scene).build()
