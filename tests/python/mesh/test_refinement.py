"""Elements cut into eight: they fill the same body, follow its surface, and stay well shaped."""

from __future__ import annotations

import numpy as np
import pytest
import surfaces
import trimesh
from conftest import box_mesh

import palpate
from palpate.mesh import filling
from palpate.mesh.curve import refine
from palpate.mesh.fit import Fit

RADIUS = 0.05


def onto_sphere(points: np.ndarray) -> np.ndarray:
    return RADIUS * points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def ball() -> palpate.TetMesh:
    with pytest.warns(palpate.MeshWarning, match="loses"):
        mesh = palpate.tetrahedralize(trimesh.creation.icosphere(4, RADIUS), 0.02)
    nodes = mesh.nodes.copy()
    nodes[mesh.surface_nodes] = onto_sphere(nodes[mesh.surface_nodes])
    return palpate.TetMesh(nodes, mesh.tets)


def test_a_box_is_filled_without_gap_or_overlap():
    mesh = box_mesh((3, 2, 2), (0.03, 0.02, 0.02))
    labelled = palpate.TetMesh(mesh.nodes, mesh.tets, np.arange(len(mesh.tets)))
    fine = refine(labelled, lambda points: points)
    assert len(fine.tets) == 8 * len(mesh.tets)
    np.testing.assert_allclose(np.bincount(fine.regions, fine.volumes), mesh.volumes, rtol=1e-12)
    assert len(fine.nodes) == 7 * 5 * 5  # those of a lattice twice as fine
    assert len(fine.surface_faces) == 4 * len(mesh.surface_faces)


@pytest.mark.slow
def test_what_a_sphere_loses_falls_with_the_square_of_the_size(ball):
    whole = 4 / 3 * np.pi * RADIUS**3
    fine = refine(ball, onto_sphere)
    finest = refine(fine, onto_sphere)
    losses = [1 - mesh.volume / whole for mesh in (ball, fine, finest)]
    assert losses[0] / losses[1] == pytest.approx(4, rel=0.15)
    assert losses[1] / losses[2] == pytest.approx(4, rel=0.15)
    for mesh in (fine, finest):
        np.testing.assert_allclose(np.linalg.norm(mesh.nodes[mesh.surface_nodes], axis=1), RADIUS, rtol=1e-9)
        assert mesh.dihedral_angles().min() > 0.6 * ball.dihedral_angles().min()


def test_a_shape_that_would_flatten_elements_is_followed_as_far_as_they_allow(ball):
    """All middles of the surface are drawn to the centre: an element that followed would be inverted."""
    fine = refine(ball, lambda points: 0.0 * points)
    assert fine.volume < ball.volume
    assert fine.dihedral_angles().min() > 0.4 * ball.dihedral_angles().min()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:surface. with elements of:palpate.MeshWarning")
@pytest.mark.parametrize(("size", "cut"), [(0.0016, True), (0.0045, False)])
def test_many_elements_are_made_of_few(monkeypatch, size, cut):
    """By NETGEN an eighth of them, unless these would be too large for the shape: a ring 20 mm thick."""
    shape, surface, run = surfaces.torus(), [], filling.Filling._run

    def counted(self, *arguments):
        surface.append(run(self, *arguments))
        return surface[-1]

    monkeypatch.setattr(filling.Filling, "_run", counted)
    monkeypatch.setattr(filling, "MOST_BY_NETGEN", 300)
    mesh = palpate.tetrahedralize(shape, size)
    counts = [len(tets) for _, tets in surface]
    assert (len(mesh.tets) == 8 * counts[0]) == cut
    assert (len(mesh.tets) == counts[-1]) != cut
    assert abs(Fit.of(mesh, shape).loss) < 0.04
    assert np.percentile(mesh.dihedral_angles(), 1) > 12
    assert mesh.dihedral_angles().min() > 5
