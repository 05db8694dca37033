"""The shipped models: counts of the paper, closed smooth surfaces, sizes of real things, usable supports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from palpate import _native, models
from palpate.errors import MeshError

EVERY = [(name, False) for name in models.NAMES] + [(name, True) for name in models.PAPER]

# Longest side, m, and volume, m3, of real ones.
REAL = {
    "doll": ((0.24, 0.26), (1.5e-3, 3.5e-3)),
    "kidney": ((0.10, 0.12), (120e-6, 250e-6)),
    "liver": ((0.19, 0.22), (0.9e-3, 1.8e-3)),
    "liver_dynamic": ((0.19, 0.22), (0.9e-3, 1.8e-3)),
    "beam": ((0.0999, 0.1001), (39.9e-6, 40.1e-6)),
}


@pytest.fixture(scope="module", params=EVERY, ids=lambda p: f"{p[0]}-paper" if p[1] else p[0])
def model(request):
    name, paper = request.param
    return name, paper, models.load(name, paper)


def test_closed_surface_without_holes(model):
    _, _, mesh = model
    triangles = mesh.surface_triangles  # drawn ones: four for a curved face
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    unique, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
    assert len(mesh.surface_nodes) - len(unique) + len(triangles) == 2
    # One sheet of triangles round every node, not two that meet in it.
    assert np.bincount(triangles.ravel())[mesh.surface_nodes].min() >= 3


def test_elements_are_well_shaped(model):
    name, paper, mesh = model
    assert (mesh.volumes > 0).all()
    lowest = {("doll", True): 10, ("kidney", True): 8}.get((name, paper), 12)
    assert mesh.dihedral_angles().min() > lowest


def test_size_of_real_ones_and_resting(model):
    name, _, mesh = model
    side, volume = REAL[name]
    assert side[0] < np.ptp(mesh.nodes, axis=0).max() < side[1]
    assert volume[0] < mesh.volume < volume[1]
    assert mesh.nodes[:, 2].min() == pytest.approx(0, abs=1e-6)


def test_supports_hold_and_leave_room_to_touch(model):
    name, _, mesh = model
    mask = models.fixed(name, mesh)
    assert mask.shape == (len(mesh.nodes),)
    assert mask.dtype == bool
    assert mask.sum() >= 10
    assert 0.03 < mask[mesh.surface_nodes].mean() < 0.25
    # Wide enough to stop the body from turning.
    assert np.sort(np.ptp(mesh.nodes[mask], axis=0))[1] > 0.15 * np.ptp(mesh.nodes, axis=0).min()


@pytest.mark.parametrize("name", models.PAPER)
def test_counts_of_the_paper(name):
    mesh, paper = models.load(name, paper=True), models.PAPER[name]
    assert len(mesh.tets) == pytest.approx(paper.tets, rel=0.05)
    if name != "liver":  # its number of nodes contradicts its elements
        assert len(mesh.nodes) == pytest.approx(paper.nodes, rel=0.05)
    if paper.surface_nodes is not None:
        assert len(mesh.surface_nodes) == paper.surface_nodes
        assert len(mesh.surface_triangles) == pytest.approx(paper.surface_triangles, rel=0.005)
        assert len(mesh.surface_triangles) == paper.surface_triangles or paper.note


@pytest.mark.parametrize("name", models.NAMES)
def test_demo_meshes_have_ten_nodes_an_element(name):
    mesh = models.load(name)
    assert mesh.is_quadratic
    assert 3000 <= len(mesh.nodes) <= 6000
    # In single precision the square of 3 s unknowns is the store, at most 220 MB.
    assert 36 * len(mesh.surface_nodes) ** 2 <= 220e6
    low, high = _native.determinant_ranges(mesh.nodes, mesh.tets.astype(np.uint32)).reshape(-1, 2).T
    assert (low / high).min() > 0.19


@pytest.mark.slow
@pytest.mark.parametrize("name", ["doll", "kidney", "liver"])
def test_demo_meshes_fill_their_shapes(name, monkeypatch):
    """The volume is that where the implicit shape is negative."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3] / "scripts"))
    from model_shapes import SHAPES

    mesh, shape, step = models.load(name), SHAPES[name], 2.0
    axes = [np.arange(a, b, step) for a, b in zip(shape.low, shape.high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = shape.field(points)
    volume = np.clip(0.5 - value / step, 0, 1).sum() * step**3 * 1e-9
    assert mesh.volume == pytest.approx(volume, rel=0.01)


def test_named_functions_load_the_same():
    assert np.array_equal(models.liver().nodes, models.load("liver").nodes)
    assert np.array_equal(models.liver(paper="dynamic").tets, models.load("liver_dynamic", paper=True).tets)
    assert len(models.doll(paper=True).surface_nodes) == 714
    assert len(models.kidney(paper=True).surface_nodes) == 454
    assert len(models.beam().nodes) > len(models.beam(paper=True).nodes)


def test_fine_beam_is_symmetric():
    """Mirrored in its middle planes, so that bending it does not twist it."""
    mesh = models.beam()
    centres = mesh.nodes[mesh.tets[:, :4]].sum(axis=1) / 0.005  # whole numbers: four corners on a grid of 5 mm
    for axis, middle in ((1, 0.0), (2, 0.01)):
        mirrored = centres.copy()
        mirrored[:, axis] = 8 * middle / 0.005 - mirrored[:, axis]
        both = [np.unique(np.round(c).astype(int), axis=0) for c in (centres, mirrored)]
        assert np.array_equal(*both)


@pytest.mark.parametrize("paper", [False, True])
def test_unknown_name(paper):
    with pytest.raises(MeshError, match=r"no model is called 'spleen'; there are doll, kidney, liver, beam") as error:
        models.load("spleen", paper)
    assert "\n" not in str(error.value)
    with pytest.raises(MeshError, match="spleen"):
        models.fixed("spleen", models.beam())
