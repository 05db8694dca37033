"""Stiffness over a surface: beside theory and a direct solution, along strokes, where a limit holds the tool."""

from __future__ import annotations

import csv

import meshio
import numpy as np
import pytest
import pyvista
from palpated import HEIGHT, RADIUS, SIDE, TOP, block_body, scene_of

import palpate
from palpate.palpation import stiffness_map
from palpate.validation.verify import palpation as benchmark
from palpate.validation.verify.contact.hidden_ball import HiddenBall

PLANE_MODULUS = 10e3 / (1 - 0.45**2)


@pytest.fixture(scope="module")
def top(block):
    return stiffness_map(block, "10mm", "0.2mm", "10mm/s", on=TOP)


def test_a_block_has_the_stiffness_of_hertz(top):
    assert len(top.points) == 36 and not top.held_by.any()
    assert np.allclose(top.points[:, 2], HEIGHT) and np.allclose(top.normals, [0, 0, 1], atol=1e-9)
    middle = np.linalg.norm(top.points[:, :2] - SIDE / 2, axis=1) < 0.01
    assert middle.sum() == 4
    hertz = 2 * PLANE_MODULUS * np.sqrt(RADIUS * top.depth)
    # The table under the block makes it harder by about the contact radius over the height.
    assert np.abs(top.stiffness[middle] / hertz - 1).max() < 0.04
    assert np.allclose(top.stiffness[middle] / top.secant_stiffness[middle], 1.5, rtol=0.02)
    # Towards an edge it is softer.
    corner = np.linalg.norm(top.points[:, :2] - SIDE / 2, axis=1) > 0.03
    assert top.stiffness[corner].max() < top.stiffness[middle].min()
    assert 1.05 * top.stiffness[middle].min() / hertz > 1.04  # another force would be seen


def test_a_curve_is_the_force_of_the_loop_at_every_tick(block, top):
    curve = top.curves[14]
    depth, at = curve.depth, top.points[14]
    assert depth[-1] == pytest.approx(0.2e-3) and np.diff(depth).max() < 1.001e-5
    place = at + [0, 0, RADIUS]
    path = place - np.column_stack([np.zeros((len(depth), 2)), depth])
    ready = np.repeat(place[None] + [0, 0, 1e-3], 400, axis=0)  # until the loop's ramp is over
    forces = palpate.Simulation(block).run(np.vstack([ready, path]))[400:]
    assert np.allclose(forces, curve.force, atol=1e-12) and curve.force[-1, 2] > 1e-3
    assert np.allclose(curve.normal_force, curve.force @ top.normals[14])
    assert (curve.force[depth < 0] == 0).all()


def test_the_same_palpation_gives_the_same_bits(block, top):
    again = stiffness_map(block, 0.01, 0.2e-3, 0.01, on=TOP)
    assert again == top


def test_strokes_feel_what_presses_feel(block):
    strokes = stiffness_map(block, "20mm", "0.3mm", on=TOP, strokes=True)
    assert strokes.strokes.max() == 2 and not strokes.held_by.any()
    presses = stiffness_map(block, "20mm", "0.3mm", points=strokes.points[::5])
    assert np.allclose(strokes.force[::5], presses.force, rtol=1e-3)
    assert np.allclose(strokes.stiffness[::5], presses.stiffness, rtol=0.01)
    # One line each, straight along x, a spacing apart.
    for rank in range(3):
        line = strokes.points[strokes.strokes == rank]
        assert np.ptp(line[:, 1]) < 1e-6 and line[0, 1] == pytest.approx(0.01 + 0.02 * rank, abs=3e-6)
        assert (np.diff(line[:, 0]) > 0).all()
        assert strokes.curves[rank].position[-1] == pytest.approx(np.ptp(line[:, 0]), rel=1e-6)


def test_what_a_limit_holds_has_no_stiffness(store):
    free = stiffness_map(scene_of(store), "20mm", "1mm", on=TOP)
    assert not free.held_by.any()
    force = float(np.sort(free.force)[3:5].mean())
    held = stiffness_map(scene_of(store, device={"max_force": force}), "20mm", "1mm", on=TOP)
    stopped = free.force > force
    assert stopped.sum() == 5 and np.ptp(free.force) > 0.05 * force
    assert (held.held_by[stopped] == "force limit").all() and np.isnan(held.stiffness[stopped]).all()
    assert (held.reached_force[stopped] <= force).all() and (held.reached_depth[stopped] < 1e-3).all()
    assert np.array_equal(held.stiffness[~stopped], free.stiffness[~stopped]) and (held.held_by[~stopped] == "").all()
    with pytest.raises(
        palpate.SceneError, match=r"no point could be pressed 1 mm deep \(strain limit, at 0\.\d+ mm at"
    ):
        stiffness_map(scene_of(store, strain_limit=0.005), "20mm", "1mm", on=TOP)


def test_the_surface_is_interpolated_where_points_are(top):
    assert np.allclose(top.at(top.points, top.normals), top.stiffness, rtol=1e-6)
    mesh = top.to_meshio()
    values, places = mesh.point_data["stiffness"], mesh.points
    on_top = places[:, 2] > HEIGHT - 1e-9
    assert np.isfinite(values[on_top]).all() and np.isnan(values[places[:, 2] < HEIGHT / 2]).all()
    assert values[on_top].min() > 0.9 * top.stiffness.min() and values[on_top].max() < 1.1 * top.stiffness.max()


def test_files_open_in_other_programs(top, tmp_path):
    written = top.save(tmp_path / "map")
    assert [path.name for path in written] == [
        "points.csv",
        "curves.csv",
        "curves.png",
        "stiffness.vtu",
        "stiffness.png",
    ]
    with (tmp_path / "map" / "points.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["stiffness_N_per_m"]) for row in rows] == pytest.approx(top.stiffness.tolist(), rel=1e-8)
    curves = np.genfromtxt(tmp_path / "map" / "curves.csv", delimiter=",", names=True)
    assert len(curves) == sum(len(curve.depth) for curve in top.curves)
    assert np.allclose(curves["normal_force_N"][curves["point"] == 5], top.curves[5].normal_force, rtol=1e-8)
    read, drawn = meshio.read(tmp_path / "map" / "stiffness.vtu"), pyvista.read(tmp_path / "map" / "stiffness.vtu")
    expected = top.to_meshio().point_data["stiffness"]
    for values in (read.point_data["stiffness"], drawn.point_data["stiffness"]):
        assert np.allclose(values, expected, equal_nan=True)
    for name in ("curves.png", "stiffness.png"):
        assert (tmp_path / "map" / name).read_bytes().startswith(b"\x89PNG")


def test_a_body_that_sags_is_pressed_where_its_surface_is(tmp_path):
    body = block_body(2e3, palpate.Loads(gravity=(0, 0, -9.81)))
    green = palpate.precompute(body, precision="f64", path=tmp_path / "sagging.palpate")
    sunk = green.free_displacements[:, 2].min()
    assert sunk < -1e-3
    found = stiffness_map(scene_of(green.path), "20mm", "0.3mm", on=TOP)
    assert (found.points[:, 2] < HEIGHT - 0.5e-3).all() and not found.held_by.any()


@pytest.mark.slow
def test_over_a_nodule_the_map_is_that_of_the_direct_solution(tmp_path):
    depth, size = 1.5e-3, 0.02
    middle = (size, size)
    scene = benchmark.slab(tmp_path, middle, benchmark.BELOW, benchmark.BALL, [middle], size=size)
    found = stiffness_map(scene, "10mm", depth, points=[(*middle, size)])
    depths = depth * benchmark.PARTS
    ball = HiddenBall(benchmark.BELOW, benchmark.BALL, size=size)
    (forces,) = ball.pressed(benchmark.TOOL, depths, benchmark.SOFT, [benchmark.MODULUS])
    force, slope = benchmark.smooth_at(depths, forces, depth)
    print(f"F {found.force} N, direct {force:g}; dF/dd {found.stiffness} N/m, direct {slope:g}")
    assert found.force[0] == pytest.approx(force, rel=0.03)
    assert found.stiffness[0] == pytest.approx(slope, rel=0.03)
