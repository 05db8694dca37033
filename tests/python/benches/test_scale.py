"""The benchmark of growing bodies: every stage is timed, rows are kept, powers are those of the rows."""

from __future__ import annotations

import json

import numpy as np
import pytest

import palpate
from benches import scale
from benches.scale_row import Job, Row, Stages, even_places, make_mesh, script, touch_region
from palpate.validation.verify.contact.loop import loop_of, sphere

STAGES = ["meshing", "surface", "body", "assembling", "ordering", "factorising", "measuring accuracy", "columns"]
STAGES += ["writing", "opening", "contact law", "first touch"]
# What the plan keeps for threads and writing, bytes: a body of 600 tetrahedra hardly uses it.
SPARE = 16e6
SETTINGS = scale.Settings(sizes=(600,), touched=100)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    path = tmp_path_factory.mktemp("scale") / "scale.json"
    reports: list[str] = []
    return path, scale.run(SETTINGS, path, reports.append), reports


@pytest.mark.slow
def test_a_row_tells_of_every_stage(measured):
    _, results, reports = measured
    row = results.rows[600]
    assert list(row.seconds) == STAGES
    assert reports == [f"600 tetrahedra: {stage}" for stage in STAGES]
    assert all(value > 0 for value in row.seconds.values())
    assert row.touched == 100
    # Halves: 2 bytes an entry.
    assert row.store >= 2 * 3 * row.touched * 3 * row.surface_nodes
    assert row.peak / 1.2 <= row.planned <= 1.2 * row.peak + SPARE
    assert 0 < row.tick_median <= row.tick_worst <= row.tick_noisy
    assert row.frame > 0


def test_rows_are_not_measured_again(measured):
    path, _, _ = measured
    held = json.loads(path.read_text())
    held["rows"][0]["store"] = 12345
    path.write_text(json.dumps(held))
    reports: list[str] = []
    assert scale.run(SETTINGS, path, reports.append).rows[600].store == 12345
    assert reports == []
    with pytest.raises(palpate.Error, match="holds rows of other settings"):
        scale.run(scale.Settings(sizes=(600,), touched=101), path)


def test_powers_are_those_of_the_rows():
    rows = {}
    for count in (1000, 10_000, 100_000):
        seconds = {"columns": 1e-6 * count**1.5, "opening": 2e-7 * count}
        sizes = {"peak": 3 * count, "store": 7, "tick_worst": 4.0}
        rows[count] = Row(count, count // 5, count // 20, 100, seconds, seconds, **sizes)
    powers = scale.exponents(scale.Results(scale.Settings(), rows))
    assert powers["columns"] == pytest.approx(1.5)
    assert powers["opening"] == pytest.approx(1.0)
    assert powers["peak"] == pytest.approx(1.0)
    assert powers["tick_worst"] == pytest.approx(0.0, abs=1e-9)
    assert "| columns | 0.0316; 0.0316 | 1; 1 | 31.6; 31.6 | 1.50 |" in scale.markdown(
        scale.Results(scale.Settings(), rows)
    )


@pytest.mark.slow
def test_a_size_that_cannot_be_measured_says_why():
    with pytest.raises(palpate.Error, match=r"600 tetrahedra cannot be measured: .*memory") as refusal:
        scale.run(scale.Settings(sizes=(600,), memory=10_000_000))
    assert "\n" not in str(refusal.value)


def test_every_place_is_pressed_and_slid_over():
    mesh = make_mesh(Job(2000), Stages(lambda _: None))
    body = palpate.Body(mesh, material=palpate.Material("10kPa", 0.45), fixed=mesh.nodes[:, 2] < 1e-9)
    touch = touch_region(mesh, 150)
    places, normals = even_places(mesh, touch)
    top = mesh.bounds[1, 2]
    np.testing.assert_allclose(places[:, 2], top, rtol=1e-9)
    np.testing.assert_allclose(normals, np.broadcast_to([0.0, 0.0, 1.0], normals.shape), atol=1e-9)
    green = palpate.precompute(body, precision="f16", touch=touch, progress=False)
    path = script(places, normals)
    forces = loop_of(body, green, [sphere(0.01, 0.3)]).run(path[:, 0])
    pressed = path[:, 0, 2] < top + 0.01 - 1e-9
    assert len(path) == 27 * len(places)
    assert pressed.sum() == 25 * len(places)
    assert (forces[pressed, 2] > 0).all()
    assert (forces[~pressed] == 0).all()
