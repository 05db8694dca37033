"""Smooth boundaries keep the volume of the voxels and lie on the shape that the voxels were made from."""

from __future__ import annotations

import numpy as np
import pytest
from label_maps import CT, ball, ellipsoid, labels_of, turned

from palpate.segmentation.smoothing import Boundary, smooth_boundary


def boundary(mask: np.ndarray, affine: np.ndarray) -> Boundary:
    """Boundary by an affine map in mm."""
    return smooth_boundary(mask, np.diag([1e-3, 1e-3, 1e-3, 1.0]) @ affine)


def enclosed(smooth: Boundary) -> float:
    """Volume by the divergence theorem, m^3."""
    corners = smooth.vertices[smooth.faces]
    return float(np.einsum("ij,ij->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2])) / 6


@pytest.mark.quick(3)
@pytest.mark.parametrize("rotation", [None, turned(), turned() @ np.diag([-1.0, 1, 1])], ids=str)
def test_ellipsoid_in_voxels_of_a_ct(rotation):
    semi = np.array([50.0, 35.0, 25.0])
    # In the axes of the scan, so that no rotation changes which slices cut it.
    own = np.eye(3) if rotation is None else rotation
    labels, affine = labels_of([lambda p: ellipsoid(semi)(p @ own)], 1.15 * semi, rotation=rotation)
    surface = boundary(labels > 0, affine)
    voxels = labels.sum() * np.prod(CT) * 1e-9
    assert surface.voxel_volume == pytest.approx(voxels, rel=1e-6)
    assert enclosed(surface) == pytest.approx(voxels, rel=1e-3)
    points = 1e3 * surface.vertices @ own
    scaled = np.linalg.norm(points / semi, axis=1)
    off = (scaled - 1) * scaled / np.linalg.norm(points / semi**2, axis=1)
    assert np.sqrt((off**2).mean()) < 0.15
    # Half a slice; the voxels' own steps reach 1.25 mm.
    assert np.abs(off).max() < 1.0


@pytest.mark.parametrize("spacing", [CT, (1.0, 1.0, 1.0), (3.0, 0.8, 0.8)], ids=str)
def test_ball_of_12_mm(spacing):
    center = np.array([1.1, -0.4, 0.7])
    labels, affine = labels_of([ball(center, 6.0)], (10, 11, 12), spacing)
    surface = boundary(labels > 0, affine)
    assert surface.volume == pytest.approx(labels.sum() * np.prod(spacing) * 1e-9, rel=1e-3)
    off = np.linalg.norm(1e3 * surface.vertices - center, axis=1) - 6.0
    assert np.sqrt((off**2).mean()) < 0.16
    np.testing.assert_allclose(1e3 * surface.vertices.mean(axis=0), center, atol=0.15)


def test_a_sheet_of_one_voxel_is_kept():
    mask = np.zeros((30, 30, 12), dtype=bool)
    mask[5:25, 5:25, 6] = True
    surface = boundary(mask, np.diag([*CT, 1.0]))
    assert surface.inside((np.array([[15 * 0.7, 15 * 0.7, 15.0]])) * 1e-3).all()
    assert enclosed(surface) == pytest.approx(surface.volume, rel=1e-6)
    assert 0.7 < surface.volume / surface.voxel_volume < 1.3


def test_a_cavity_stays_and_the_edge_of_the_image_is_reported():
    labels, affine = labels_of([ball((0, 0, 0), 20), ball((0, 0, 3), 7)], (25, 25, 25))
    surface = boundary(labels == 1, affine)
    assert not surface.at_edge and not surface.inside(np.array([[0, 0, 3e-3]])).any()
    assert surface.inside(np.array([[0, 0, 15e-3]])).all()
    cut, affine = labels_of([ball((0, 0, 0), 20)], (25, 25, 10))
    surface = boundary(cut > 0, affine)
    assert surface.at_edge
    assert enclosed(surface) == pytest.approx(surface.voxel_volume, rel=1e-3)


@pytest.mark.slow
def test_fine_voxels_are_averaged_without_a_change_of_volume():
    labels, affine = labels_of([ball((0, 0, 0), 15)], (16, 16, 16), (0.1, 0.1, 0.5))
    surface = boundary(labels > 0, affine)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 0.015**3, rel=2e-3)
    assert max(surface.field.shape) < 200
    off = np.linalg.norm(surface.vertices, axis=1) - 0.015
    assert np.abs(off).max() < 3e-4
