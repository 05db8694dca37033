"""Where a palpation presses: evenly, off supports and edges, where the body may be touched."""

from __future__ import annotations

import numpy as np
import pytest
from palpated import HEIGHT, SIDE, TOP, block_body, scene_of
from scipy.spatial import cKDTree

import palpate
from palpate.palpation.protocol import Protocol, sample_sites
from palpate.palpation.runs import probe
from palpate.simulation import Simulation


def sites(scene, spacing, depth=1e-3, on=None):
    return sample_sites(Simulation(probe(scene.build())), Protocol(spacing, depth, 0.01), on)


def test_a_flat_side_gets_a_square_lattice(store):
    found = sites(scene_of(store), 0.01, on=TOP)
    ticks = np.arange(0.005, SIDE, 0.01)
    expected = np.array([(x, y, HEIGHT) for y in ticks for x in ticks])
    assert np.abs(found.points - expected).max() < 1e-6 and found.skipped == {}


def test_all_sides_are_visited_but_for_the_glued_one(store):
    found = sites(scene_of(store), 0.01)
    assert len(found.points) == 36 + 4 * 24
    assert found.skipped == {"by a support": 36}
    # The contact of 4 mm spheres 1 mm deep is 2 mm wide; a wider grid's points come closer to no edge.
    near = sites(scene_of(store), 0.003, on=TOP)
    assert near.skipped == {"by an edge": 20**2 - 18**2}
    assert near.points[:, :2].min() > 2e-3


def test_a_curved_surface_is_covered_evenly():
    scene = palpate.scene.model_scene("kidney", paper=True)
    spacing = 0.012
    found = sites(scene, spacing)
    green = scene.build().bodies[0].green
    places = np.hstack([found.points, spacing * found.normals])
    apart = cKDTree(places).query(places, k=2)[0][:, 1]
    # A hexagonal packing has the spacing itself; points at random would be half as far apart, some on each other.
    assert 0.75 * spacing < np.median(apart) < 1.15 * spacing and apart.min() > 0.45 * spacing
    fixed = green.surface_positions[np.isin(green.surface_nodes, green.fixed_nodes)]
    radius = scene.tools[0].radius
    assert cKDTree(fixed).query(found.points)[0].min() > 0.9 * np.sqrt(radius * 1e-3)
    assert found.skipped["by a support"] > 10
    again = sites(scene, spacing)
    assert np.array_equal(again.points, found.points) and np.array_equal(again.normals, found.normals)


def test_what_may_not_be_touched_is_left_out_and_counted(tmp_path):
    body = block_body()
    surface = body.mesh.surface_nodes
    left = surface[body.mesh.nodes[surface, 0] < 0.0301]
    palpate.precompute(body, precision="f32", touch=left, path=tmp_path / "part.palpate")
    found = sites(scene_of(tmp_path / "part.palpate"), 0.01, on=TOP)
    assert len(found.points) == 18 and found.points[:, 0].max() < 0.03
    assert found.skipped == {"not touchable": 18}


@pytest.mark.parametrize(
    ("spacing", "on", "words"),
    [
        (0.1, None, "a grid of 100 mm is wider than the body of 60 x 60 x 40 mm"),
        (2e-4, None, "than 5000: give a wider one"),
        (0.01, "z > 1m", "no point to press where z > 1m"),
        (0.01, "z < 1mm", "36 by a support"),
    ],
)
def test_a_grid_that_makes_no_sense_is_refused(store, spacing, on, words):
    with pytest.raises(palpate.SceneError, match=words) as error:
        sites(scene_of(store), spacing, on=on)
    assert "\n" not in str(error.value)
