"""Elastic constants at the surface: from the elements, and from a store alone."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate import _native
from palpate.body import problem_arrays, surface_moduli
from palpate.scene import BuiltBody
from palpate.simulation.native import body_arguments

UNPLACED = {"materials": {"0": [5e3, 0.45, 1000.0], "1": [40e3, 0.3, 1000.0]}}
SOFT, STIFF = palpate.Material(5e3, 0.45), palpate.Material(40e3, 0.3)


def two_halves() -> palpate.Body:
    mesh = box_mesh((6, 4, 4))
    middle = mesh.nodes[:, 0].mean()
    right = mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > middle
    halves = palpate.TetMesh(mesh.nodes, mesh.tets, right.astype(np.int64))
    return palpate.Body(halves, material={0: SOFT, 1: STIFF}, fixed=lambda p: p[:, 2] < 1e-9)


def test_nodes_have_the_mean_of_the_elements_around():
    body = two_halves()
    young, poisson = surface_moduli(body)
    x = body.mesh.nodes[body.mesh.surface_nodes, 0]
    spacing = np.ptp(x) / 6
    left, right = x < x.mean() - 0.5 * spacing, x > x.mean() + 0.5 * spacing
    assert np.all(young[left] == 5e3) and np.allclose(young[right], 40e3, rtol=1e-12)
    assert np.allclose(poisson[left], 0.45, rtol=1e-12) and np.allclose(poisson[right], 0.3, rtol=1e-12)
    between = young[~left & ~right]
    assert np.all((between > 5e3) & (between < 40e3))


def test_a_bare_store_of_two_materials_is_touched_as_its_body_is(tmp_path):
    body = two_halves()
    store = tmp_path / "halves.palpate"
    green = palpate.precompute(body, precision="f64", path=store, progress=False)
    *known, of_one_material = green._core.surface_moduli()
    for found, expected in zip(known, surface_moduli(body), strict=True):
        assert np.array_equal(found, expected)
    assert not of_one_material
    top = green.surface_positions[:, 2].max()
    path = np.array([0.07, 0.02, top + 0.005]) - np.linspace(-1e-4, 1e-3, 50)[:, None] * [0, 0, 1]
    limits = {"device": {"ramp": 0}, "view": {"strain_limit": 0}}
    bare = palpate.Simulation(palpate.Scene(body={"store": str(store)}, **limits)).run(path)
    whole = palpate.scene.BuiltScene.of(palpate.Scene(body={"store": str(store)}, **limits), body, green)
    assert np.abs(bare[-1]).max() > 0.01
    assert np.array_equal(bare, palpate.Simulation(whole).run(path))


def test_a_store_that_does_not_say_where_its_materials_are_is_refused_under_the_local_law():
    body = two_halves()
    core = _native.GreenCore.precompute(problem_arrays(body, None), "f64", json.dumps(UNPLACED), None)
    bare = BuiltBody(None, palpate.GreensFunction(core))
    assert body_arguments(bare, local=False)[4] is None
    with pytest.raises(palpate.BodyError, match="compute it again"):
        body_arguments(bare, local=True)
