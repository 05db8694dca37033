"""The table of what may be touched."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.mesh import TetMesh


@pytest.fixture
def folder(tmp_path):
    mesh = box_mesh((5, 4, 4))
    upper = mesh.nodes[mesh.tets].mean(axis=1)[:, 2] > 0.03
    TetMesh(mesh.nodes, mesh.tets, np.where(upper, 2, 1), {"rest": 1, "lid": 2}).write(tmp_path / "block.msh")
    return tmp_path


def scene(folder, touch: str) -> palpate.Scene:
    text = f'[body]\nmesh = "block.msh"\nunit = "m"\n[supports]\nfixed = "x < 1mm"\n{touch}'
    (folder / "scene.toml").write_text(text)
    return palpate.Scene.read(folder / "scene.toml")


@pytest.mark.parametrize(
    ("touch", "inside"),
    [
        ('region = "z > 3cm"', lambda p: p[:, 2] > 0.03),
        ('region = { shape = "half-space", point = ["5cm", 0, 0], normal = [-1, 0, 0] }', lambda p: p[:, 0] >= 0.05),
        ("region = [0, 1]", lambda p: np.arange(len(p)) < 2),
        ('first = "z > 3cm"', lambda p: p[:, 0] > -1),
    ],
)
def test_what_may_be_touched_is_what_it_says(folder, touch, inside):
    green = scene(folder, f"[touch]\n{touch}").build(progress=False).bodies[0].green
    nodes = green.surface_nodes[inside(green.body.mesh.nodes)[green.surface_nodes]]
    assert np.array_equal(green.touchable_nodes, nodes)


@pytest.mark.parametrize("named", ['"lid"', '{ mesh_region = "lid" }', "{ mesh_region = 2 }"])
def test_a_region_of_the_mesh_file_gives_its_nodes_on_the_surface(folder, named):
    green = scene(folder, f"[touch]\nregion = {named}").build(progress=False).bodies[0].green
    mesh = green.body.mesh
    # The number of a region of the file becomes another in the body, whose regions are those of the scene.
    upper = mesh.nodes[mesh.tets].mean(axis=1)[:, 2] > 0.03
    assert np.array_equal(green.touchable_nodes, np.intersect1d(mesh.tets[upper], mesh.surface_nodes))


@pytest.mark.parametrize(
    ("touch", "message"),
    [
        ('region = "z > "', r"scene.toml:7: touch.region: cannot read the predicate"),
        ("region = 3", r"scene.toml:7: touch.region: give a predicate"),
        ("region = []", r"scene.toml:7: touch.region: give a predicate"),
        ("regoin = 'z > 0'", r"scene.toml:7: unknown key 'touch.regoin'; did you mean 'region'"),
        ("first = { shape = 'sphere' }", r"scene.toml:7: touch.first: a sphere needs center and radius"),
        ("first = { shape = 'sphere', cente = 1 }", r"scene.toml:7: unknown key 'touch.first.cente'"),
    ],
)
def test_mistakes_are_told_with_their_line(folder, touch, message):
    with pytest.raises(palpate.SceneError, match=message):
        scene(folder, f"[touch]\n{touch}")


@pytest.mark.parametrize(
    ("touch", "message"),
    [
        ('region = "z > 3m"', r"scene.toml:6: touch: no surface node lies in 'z > 3m'"),
        ('region = "z > 3cm"\nfirst = "z < 1cm"', r"scene.toml:6: touch: first: none of its nodes may be touched"),
    ],
)
def test_regions_that_hold_nothing_are_told_with_their_line(folder, touch, message):
    with pytest.raises(palpate.SceneError, match=message):
        scene(folder, f"[touch]\n{touch}").build(progress=False)


def test_a_body_has_its_own_table(folder):
    text = '[[body]]\nmesh = "block.msh"\nunit = "m"\n[body.touch]\nregion = "lid"\n[supports]\nfixed = "x < 1mm"'
    (folder / "scene.toml").write_text(text)
    green = palpate.Scene.read(folder / "scene.toml").build(progress=False).bodies[0].green
    assert len(green.touchable_nodes) < len(green.surface_nodes)
