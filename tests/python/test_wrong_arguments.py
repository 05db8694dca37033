"""Arguments of a wrong kind: one line of a palpate.Error, in place of an error of Python or NumPy."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.fields import StressRecovery

FORCE, DEPTH = np.arange(6.0), 1e-3 * np.arange(6.0)
POSE = np.array([0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0])


def refused(error, message, make, *arguments, **keywords):
    with pytest.raises(error, match=message) as raised:
        make(*arguments, **keywords)
    assert "\n" not in str(raised.value)


def test_displacements_of_a_recovery(block):
    recovery, inside, surface = StressRecovery(block), len(block.mesh.nodes), len(block.mesh.surface_nodes)
    for recover, count in ((recovery.recover, surface), (recovery.recover_inside, inside)):
        refused(palpate.BodyError, "displacements must be an array of real numbers, got 'abc'", recover, "abc")
        refused(palpate.BodyError, "must be an array of real numbers", recover, np.full((count, 3), 1j))
        for wrong in (np.zeros((3, 3)), np.full((count, 3), np.nan)):
            refused(palpate.BodyError, rf"must be finite and of shape \({count}, 3\)", recover, wrong)


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"dt": "abc"}, palpate.UnitError, "'abc' is not a time"),
        ({"dt": None}, palpate.UnitError, "None is not a time"),
        ({"rayleigh": 3}, palpate.BodyError, r"rayleigh must be two factors.*got 3"),
        ({"rayleigh": ("a", 1)}, palpate.BodyError, "a factor of rayleigh must be a finite number, got 'a'"),
        ({"alpha": "x"}, palpate.BodyError, "alpha must be a finite number, got 'x'"),
        ({"velocities": "abc"}, palpate.BodyError, "the initial velocities must be an array of real numbers"),
    ],
)
def test_settings_of_newmarks_scheme(block, settings, error, message):
    refused(error, message, palpate.Newmark, block, progress=False, **settings)


def test_forces_and_nodes_of_newmarks_scheme(block):
    refused(palpate.BodyError, "Newmark takes a palpate.Body, got 'x'", palpate.Newmark, "x")
    motion = palpate.Newmark(block, dt="1ms", modes=3, progress=False)
    assert motion.dt == 1e-3
    history, node = np.zeros((2, 1, 3)), int(np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)[0])
    for wrong in (5, [1, 2]):
        refused(palpate.BodyError, "forces must map nodes to three numbers", motion.step, wrong)
    refused(palpate.BodyError, "nodes must be a list of node numbers, got 7", motion.play, 7, history)
    refused(palpate.BodyError, "watch must be a list of node numbers, got 7", motion.play, [node], history, 7)
    refused(palpate.BodyError, "watch: node 'a' does not exist", motion.play, [node], history, ["a"])
    for wrong in ("abc", history + 1j):
        refused(palpate.BodyError, "forces must be an array of real numbers", motion.play, [node], wrong)


def test_arguments_of_plans_and_solutions(block, block_green):
    for wrong in (5, "5mm", [-1], [float("nan")], [0.0]):
        refused(palpate.BodyError, "radii must be a list of positive lengths", palpate.plan, block, radii=wrong)
    assert palpate.plan(block, radii=["5mm"]) is not None
    for make in (palpate.plan, palpate.precompute):
        refused(palpate.BodyError, "unknown precision 5: use 'f16', 'f32', 'f64'", make, block, precision=5)
    for wrong in (5, "7"):
        refused(palpate.BodyError, "release must be a list of fixed nodes", block_green.solve, release=wrong)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": "abc"}, "nodes must be an array of real numbers, got 'abc'"),
        ({"nodes": [[1, 2], [3]]}, "nodes must be an array of real numbers"),
        ({"nodes": 1j * np.ones((4, 3))}, "nodes must be an array of real numbers"),
        ({"regions": "abc"}, "regions must be an array of real numbers, got 'abc'"),
        ({"regions": [0.5]}, r"regions must be whole numbers, got \[0.5\]"),
        ({"region_names": 5}, "region_names must map names to labels, got 5"),
    ],
)
def test_arrays_of_a_mesh(change, message):
    given = {"nodes": np.vstack([np.zeros(3), np.eye(3)]), "tets": [[0, 1, 2, 3]]}
    assert len(palpate.TetMesh(**given, regions=[7.0]).tets) == 1
    refused(palpate.MeshError, message, palpate.TetMesh, **{**given, **change})


def test_poses_and_tools(block_green):
    scene = palpate.Scene(body={"store": str(block_green.path)})
    simulation, sensor = palpate.Simulation(scene), palpate.Sensor(scene, 2)
    poses = np.tile(POSE, (2, 1))
    poses[1, 0] = -np.inf
    words = "the position of tool 0 of copy 1 is infinite; NaN takes a tool out of the scene"
    refused(palpate.SceneError, words, sensor.step, poses)
    refused(palpate.SceneError, "poses must be an array of real numbers", sensor.step, np.tile(POSE + 0j, (2, 1)))
    refused(palpate.SceneError, "positions must be an array of real numbers", simulation.play, np.full((3, 3), 1j))
    refused(palpate.SceneError, "^tool: unknown shape 'foo'; known are 'sphere'", simulation.add_tool, shape="foo")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"points": [(0, 0)]}, r"points must be \(1, 3\) finite numbers, one row a curve, got \(1, 2\)"),
        ({"points": [(0, 0, np.nan)]}, "points must be"),
        ({"force": [], "depth": []}, "indentations need rows of force and depth, got none"),
        ({"radius": -1}, "the radius of the indenter must be positive, got -1 m"),
        ({"radius": float("nan")}, "the radius of the indenter must be positive, got nan m"),
        ({"force": "abc"}, "force of indentations must be an array of real numbers, got 'abc'"),
        ({"force": FORCE + 1j}, "force of indentations must be an array of real numbers"),
        ({"curve": ["a"] * 6}, "curve must be an array of real numbers"),
    ],
)
def test_indentations(given, message):
    refused(palpate.FitError, message, palpate.Indentations, **{"force": FORCE, "depth": DEPTH, **given})


def test_depths_of_a_fit_in_another_unit_and_a_single_key_that_is_held(block, tmp_path):
    block.mesh.write(tmp_path / "block.vtu")
    scene = palpate.Scene(
        body={"mesh": str(tmp_path / "block.vtu"), "unit": "m"},
        supports={"fixed": "x < 1mm"},
        tool={"radius": "6mm"},
    )
    words = r"curve 1: a depth of .* mm is beyond ten radii of the tool, which are 60 mm: .* \(--depth-unit\)"
    for factor in (1e3, 13.0):
        refused(palpate.FitError, words, palpate.fit, scene, palpate.Indentations(FORCE, factor * DEPTH))
    sheet = {"shape": "punch", "radius": "6mm"}
    punched = scene.model_copy(update={"tools": palpate.Scene(body={"model": "beam"}, tool=sheet).tools})
    deep = palpate.Indentations(FORCE, 1e3 * DEPTH)
    refused(palpate.FitError, "is beyond the body, whose longest side is 80 mm", palpate.fit, punched, deep)
    few = palpate.Indentations(FORCE, DEPTH)
    refused(palpate.FitError, "there is no 'poisson' to hold", palpate.fit, scene, few, hold="poisson")
