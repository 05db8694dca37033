"""Scene files with several bodies and tools, and what is said of mistakes in them."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate

SINGLE = """\
[body]
mesh = "a.vtu"
precision = "f64"

[supports]
fixed = "z < 1e-6"

[material]
youngs_modulus = "12kPa"
poissons_ratio = 0.3

[tool]
radius = "4mm"
"""

SEVERAL = """\
[[body]]
name = "left"
mesh = "a.vtu"
precision = "f64"

[[body]]
mesh = "b.vtu"
precision = "f64"
position = ["120mm", 0, "5mm"]
orientation = [0.6, 0, 0, 0.8]

[body.material]
youngs_modulus = "30kPa"
poissons_ratio = 0.2
density = 1100

[body.supports]
fixed = "x < 1e-6"

[[body.region]]
shape = "sphere"
center = ["25mm", "25mm", "20mm"]
radius = "12mm"
youngs_modulus = "90kPa"

[[body.region]]
shape = "half-space"
point = [0, 0, "35mm"]
normal = [0, 0, -1]
youngs_modulus = "60kPa"

[[body.loads]]
gravity = [0, 0, -9.81]

[supports]
fixed = "z < 1e-6"

[material]
youngs_modulus = "12kPa"
poissons_ratio = 0.3

[[tool]]
radius = "4mm"

[[tool]]
radius = "6mm"
contact = "node"
"""


@pytest.fixture
def folder(tmp_path):
    box_mesh((4, 3, 3)).write(tmp_path / "a.vtu")
    box_mesh((4, 4, 3), size=(0.05, 0.05, 0.04)).write(tmp_path / "b.vtu")
    return tmp_path


def read(folder, text: str) -> palpate.Scene:
    (folder / "s.toml").write_text(text)
    return palpate.Scene.read(folder / "s.toml")


def test_a_single_table_is_a_list_of_one(folder):
    scene = read(folder, SINGLE)
    assert len(scene.bodies) == len(scene.tools) == 1
    listed = read(folder, SINGLE.replace("[body]", "[[body]]").replace("[tool]", "[[tool]]"))
    assert listed.model_dump() == scene.model_dump()
    tables = {"supports": scene.supports, "material": scene.material}
    result = palpate.Scene(body=scene.bodies[0], tool=scene.tools[0], **tables)
    assert result.model_dump() == scene.model_dump()
    (built,) = scene.build().bodies
    assert built.name == "a" and built.position == (0, 0, 0) and built.orientation == (1, 0, 0, 0)
    assert (built.body.element_materials[:, 0] == 12e3).all()


def test_tables_of_a_body_come_before_those_of_the_scene(folder):
    scene = read(folder, SEVERAL)
    assert scene.name == "left-b" and [tool.contact for tool in scene.tools] == ["local", "node"]
    left, right = scene.build().bodies
    assert (left.name, right.name) == ("left", "b")
    # The first takes what the scene says, the second what is its own.
    assert (left.body.element_materials[:, :2] == [12e3, 0.3]).all() and left.green.youngs_modulus == 12e3
    assert np.array_equal(left.body.fixed_nodes, np.flatnonzero(left.body.mesh.nodes[:, 2] < 1e-6))
    assert np.abs(left.green.free_displacements).max() == 0
    centroids = right.body.mesh.nodes[right.body.mesh.tets].mean(axis=1)
    expected = np.tile([30e3, 0.2, 1100.0], (len(centroids), 1))
    expected[np.linalg.norm(centroids - [0.025, 0.025, 0.02], axis=1) < 0.012, 0] = 90e3
    expected[centroids[:, 2] > 0.035, 0] = 60e3
    assert len(np.unique(expected[:, 0])) == 3
    assert np.array_equal(right.body.element_materials, expected)
    assert np.array_equal(right.body.fixed_nodes, np.flatnonzero(right.body.mesh.nodes[:, 0] < 1e-6))
    weight = 1100 * 9.81 * right.body.mesh.volume
    assert right.body.load_vector().sum(axis=0) == pytest.approx([0, 0, -weight], rel=1e-9)


def test_a_body_is_placed(folder):
    right = read(folder, SEVERAL).build().bodies[1]
    # 0.6 + 0.8 k turns about z by an angle whose cosine is -0.28 and sine 0.96.
    turn = np.array([[-0.28, -0.96, 0], [0.96, -0.28, 0], [0, 0, 1]])
    points = np.random.default_rng(2).normal(size=(5, 3))
    placed = points @ turn.T + [0.12, 0, 0.005]
    assert right.points_to_scene(points) == pytest.approx(placed, abs=1e-15)
    assert right.points_to_body(placed) == pytest.approx(points, abs=1e-15)
    assert right.vectors_to_scene(points) == pytest.approx(points @ turn.T, abs=1e-15)


def test_tools_reach_the_body_where_it_is_placed(folder):
    scene = read(folder, SEVERAL)
    simulation = palpate.Simulation(scene)
    top = simulation.bodies[1].points_to_scene([0.03, 0.02, 0.04])
    path = np.stack([top + [0, 0, z] for z in np.linspace(0.01, -0.008, 61)])
    forces = simulation.run(path)
    assert forces.shape == (61, 3) and forces[-1, 2] > 0.1 and np.abs(forces[0]).max() == 0
    # A tool that is not spoken of is out of the scene.
    both = np.stack([path, np.full_like(path, np.nan)], axis=1)
    assert np.array_equal(simulation.play(both).forces[:, 0], forces)
    assert np.array_equal(simulation.run(path[:, None])[:, 0], forces)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("density = 1100", "densty = 1100", r"s\.toml:15: unknown key 'body.material.densty'; did you mean 'density'"),
        ('"30kPa"', '"30 kilo"', r"s\.toml:13: body.material.youngs_modulus: unknown unit 'kilo'"),
        ('fixed = "x < 1e-6"', 'fixd = "x < 0"', r"s\.toml:18: unknown key 'body.supports.fixd'; did you mean 'fixed'"),
        ('fixed = "x < 1e-6"', "", r"s\.toml:17: the key 'supports.fixed' is missing for body 'b'"),
        ('fixed = "x < 1e-6"', 'fixed = "x > 1"', r"no node satisfies supports.fixed = 'x > 1'"),
        ('youngs_modulus = "60kPa"', "stiffness = 1", r"s\.toml:30: unknown key 'body.region.stiffness'; known are"),
        ("normal = [0, 0, -1]\n", "", r"s\.toml:26: .*region.*'normal' is missing"),
        ('point = [0, 0, "35mm"]', 'point = [0, 0, "3m"]', r"s\.toml:26: region: no element has its centroid"),
        ("[0, 0, -9.81]", "[0, -9.81]", r"s\.toml:33: body.loads.gravity has too few entries"),
        (
            "orientation = [0.6, 0, 0, 0.8]",
            "orientation = [0.6, 0, 0, 0.7]",
            r"s\.toml:10: body\.orientation: must be a unit",
        ),
        (
            "orientation = [0.6, 0, 0, 0.8]",
            "orientation = [1, 0, 0]",
            r"s\.toml:10: body.orientation.* too few entries",
        ),
        ("position =", "positon =", r"s\.toml:9: unknown key 'body.positon'; did you mean 'position'"),
        ('contact = "node"', 'contakt = "node"', r"s\.toml:47: unknown key 'tool.contakt'; did you mean 'contact'"),
        ('radius = "6mm"', 'radius = "-6mm"', r"s\.toml:46: tool.radius: .*greater than 0"),
        (
            'mesh = "b.vtu"',
            'mesh = "b.vtu"\nmodel = "beam"',
            r"s\.toml:6: body: give exactly one of mesh, model and store",
        ),
    ],
)
def test_mistakes_in_the_second_table_are_named_with_their_line(folder, old, new, message):
    assert SEVERAL.count(old) == 1
    with pytest.raises(palpate.SceneError, match=message):
        read(folder, SEVERAL.replace(old, new)).build()


def test_a_body_without_supports_is_refused_by_name(folder):
    text = SINGLE.replace("[body]", '[[body]]\nname = "first"').replace('[supports]\nfixed = "z < 1e-6"\n', "")
    second = '[body.supports]\nfixed = "z < 1e-6"\n\n[[body]]\nname = "loose"\nmesh = "b.vtu"\n\n[material]'
    with pytest.raises(palpate.SceneError, match=r"s\.toml:10: the key 'supports.fixed' is missing for body 'loose'"):
        read(folder, text.replace("[material]", second))


@pytest.mark.parametrize(("table", "most"), [("body", 4), ("tool", 4)])
def test_too_many_bodies_or_tools_are_refused(folder, table, most):
    more = {"body": '[[body]]\nmesh = "b.vtu"\n', "tool": '[[tool]]\nradius = "3mm"\n'}[table]
    assert len(getattr(read(folder, SEVERAL + (most - 2) * more), {"body": "bodies", "tool": "tools"}[table])) == most
    with pytest.raises(palpate.SceneError, match=rf"s\.toml:\d+: {table}: .*at most {most}"):
        read(folder, SEVERAL + (most - 1) * more)
    none = SINGLE[: SINGLE.index("[tool]")] if table == "tool" else SINGLE[SINGLE.index("[supports]") :]
    with pytest.raises(palpate.SceneError, match=rf"s\.toml:1: {table}: .*at least 1"):
        read(folder, f"{table} = []\n" + none)


def test_a_store_among_several_takes_no_tables_of_its_own(folder):
    read(folder, SINGLE).build(progress=False).bodies[0].green.save(folder / "a.palpate")
    several = SEVERAL.replace('mesh = "a.vtu"\nprecision = "f64"', 'store = "a.palpate"')
    built = read(folder, several).build().bodies
    assert built[0].body is None and built[1].body is not None
    assert built[0].green.youngs_modulus == 12e3
    with pytest.raises(palpate.SceneError, match="a store has its own material"):
        read(folder, several.replace('store = "a.palpate"', 'store = "a.palpate"\nmaterial = { youngs_modulus = 1e3 }'))
