"""Taylor series of bodies beyond small strain, beside solvers of other meshes and elements."""

from __future__ import annotations

import itertools
import shutil

import numpy as np
import pytest

import palpate
from palpate.green.series import SeriesJob, series_beside
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_series
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import UNLIMITED, sphere
from palpate.validation.verify.contact.reference import Block, finer_in_the_middle

RADIUS = 0.01
# Tetrahedra of a cuboid, by its corners 4 x + 2 y + z.
CUBOID = ((0, 4, 6, 7), (0, 4, 7, 5), (0, 5, 7, 1), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7))
BEAM = (0.1, 0.02, 0.02)
# Depth, m, and force, N, of a sphere of 10 mm on that beam 20 mm from its end, E = 10 kPa, nu = 0.45: full Newton's
# method and augmented Lagrangians on the same 10-node elements (`benches/strain/solid.py`).
DEPTHS = np.array([5.0, 10.0, 14.0, 20.0]) * 1e-3
FORCES = np.array([3.959e-3, 8.159e-3, 1.148e-2, 1.604e-2])
# Its contact on elements of 5 mm is too stiff by about that.
ALLOWED = 3.7e-2


def cantilever(law: str) -> palpate.Body:
    counts = (20, 4, 4)
    axes = [np.linspace(0.0, length, count + 1) for length, count in zip(BEAM, counts, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    number = np.arange(len(nodes)).reshape([count + 1 for count in counts])
    tets = []
    for i, j, k in itertools.product(*map(range, counts)):
        corners = [number[i + a, j + b, k + c] for a, b, c in itertools.product((0, 1), repeat=3)]
        tets += [[corners[corner] for corner in tet] for tet in CUBOID]
    mesh = palpate.TetMesh(nodes, np.array(tets)).to_quadratic()
    material = palpate.Material(10e3, 0.45, law=law)
    return palpate.Body(mesh, material=material, fixed=lambda places: places[:, 0] < 1e-9)


def built(body: palpate.Body, friction: float = 0.0, series: bool = True) -> BuiltScene:
    table = {"name": "body", "model": "liver"}  # the table asks for a source; the body is given
    scene = Scene(body=table, tool=[sphere(RADIUS, friction)], device=UNLIMITED, view={"strain_limit": 0.0})
    # From the cache of all tests: beam and series are computed once.
    green = palpate.precompute(body, precision="f64", progress=False)
    of_body = BuiltScene.of(scene, body, green)
    return with_series(of_body) if series else of_body


def polyline(*corners: tuple[float, float, float], count: int) -> np.ndarray:
    shares = np.linspace(0.0, 1.0, count, endpoint=False)[:, None]
    pairs = itertools.pairwise(np.array(corners))
    return np.vstack([*(start + shares * (end - start) for start, end in pairs), corners[-1:]])


def forces_on(scene: BuiltScene) -> np.ndarray:
    """Press above the axis at DEPTHS; return vertical forces on the sphere."""
    path = polyline((0.08, 0.01, 0.0305), (0.08, 0.01, 0.01), count=2050)
    forces = Simulation(scene).run(path)[:, 2]
    return np.interp(-DEPTHS, (path[:, 2] - 0.03)[::-1], forces[::-1])


def test_a_bent_beam_has_the_force_of_a_full_solution():
    np.testing.assert_allclose(forces_on(built(cantilever("neo-hookean"))), FORCES, rtol=ALLOWED)


def test_without_the_series_a_beam_is_too_stiff():
    for scene in (built(cantilever("linear")), built(cantilever("neo-hookean"), series=False)):
        assert (forces_on(scene) / FORCES)[-1] > 1.0 + 4.0 * ALLOWED


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.4, marks=pytest.mark.slow)])
def test_a_closed_path_on_a_beam_gives_out_nothing(friction):
    corners = ((0.08, 0.01, 0.0305), (0.08, 0.01, 0.015), (0.06, 0.012, 0.018), (0.06, 0.012, 0.0305))
    path = polyline(*corners, count=400)
    forces = -Simulation(built(cantilever("neo-hookean"), friction)).run(path)
    work = np.cumsum((0.5 * (forces[1:] + forces[:-1]) * np.diff(path, axis=0)).sum(axis=1))
    assert work.max() > 1e-4
    if friction == 0.0:
        assert abs(work[-1]) < 1e-6 * work.max()
        # Forces of a place that is a tick old are no gradient.
        stale = np.cumsum((0.5 * (forces[:-2] + forces[1:-1]) * np.diff(path, axis=0)[1:]).sum(axis=1))
        assert abs(stale[-1]) > 1e-4 * stale.max()
    else:
        assert work[-1] > 1e-3 * work.max()


def test_forces_do_not_jump_and_repeat_to_the_bit():
    scene = built(cantilever("neo-hookean"))
    path = polyline((0.085, 0.01, 0.0305), (0.085, 0.01, 0.018), (0.045, 0.012, 0.022), count=1500)
    forces = Simulation(scene).run(path)
    steps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    assert steps.max() < 5e-3 * np.linalg.norm(forces, axis=1).max()
    assert np.array_equal(forces, Simulation(scene).run(path))


@pytest.mark.slow
def test_the_series_of_a_block_is_that_of_axisymmetric_elements():
    """A patch of 30 mm on a cylinder of 100 mm radius and 50 mm height, less that on a half-space (`patch_series`)."""
    modulus, width, expected = 10e3, 0.03, (-0.05964, -0.05246)
    material = palpate.Material(modulus, 0.45, law="neo-hookean")
    body = finer_in_the_middle(Block((0.2, 0.2, 0.05), material), 0.005, 0.02, quadratic=True)
    middle = np.array([0.1, 0.1, 0.05])
    surface = body.mesh.surface_nodes
    near = surface[np.linalg.norm(body.mesh.nodes[surface] - middle, axis=1) < 0.1 * width]
    # The patch of a sphere is 7.5 times as wide as its radius.
    series = SeriesJob.of(green_of(body, touch=near), body, width / 7.5).compute()
    place = series.fields[np.linalg.norm(series.positions - middle, axis=1).argmin()]
    cubic, quartic, bending = place[:3], place[3:6], place[8]
    # Pressed along -z, U_3 = -b_z F^3 and q_2 = 3 U_3 / F.
    second = -3.0 * cubic[2]
    # In powers of y = F - alpha F^2 + ..
    third = -4.0 * quartic[2] - 2.0 * bending * second
    found = (second * modulus**2 * width**3, third * modulus**3 * width**5)
    assert found[0] == pytest.approx(expected[0], rel=2e-2)
    for factor in (0.95, 1.05):
        assert factor * found[0] != pytest.approx(expected[0], rel=2e-2)
    assert found[1] == pytest.approx(expected[1], rel=8e-2)
    # By symmetry.
    assert np.abs(cubic[:2]).max() < 3e-2 * abs(cubic[2])


def test_the_series_is_stored_and_linear_bodies_have_none(tmp_path):
    body = cantilever("neo-hookean")
    computed = palpate.precompute(body, precision="f64", progress=False)
    first = SeriesJob.of(computed, body, RADIUS).compute()
    for path in (computed.path, *series_beside(computed.path)):
        shutil.copy(path, tmp_path)
    green = palpate.GreensFunction.load(tmp_path / computed.path.name, body=body)
    (file,) = series_beside(green.path)
    damaged = file.read_bytes()[:-100] + bytes(100)
    file.write_bytes(damaged)
    again = SeriesJob.of(green, body, RADIUS).compute()
    assert np.array_equal(first.fields, again.fields) and np.array_equal(first.positions, again.positions)
    assert file.read_bytes() != damaged
    assert SeriesJob.of(green, cantilever("linear"), RADIUS) is None


@pytest.mark.slow
def test_a_replay_has_the_series_of_its_recording():
    body = cantilever("neo-hookean")
    path = polyline((0.08, 0.01, 0.0305), (0.08, 0.01, 0.018), count=300)
    for series in (True, False):
        scene = built(body, series=series)
        recording = Simulation(scene).play(path)
        assert palpate.replay(recording, built(body)).same
