"""Smooth boundary of a mask of voxels that encloses the volume of its voxels.

The mask, 1 inside and 0 outside, is blurred with a Gaussian of standard deviation `w`, the same in mm along all axes,
so that the steps between slices go. The boundary is where the blurred mask has a value `t`. At `t` = 1/2 a flat wall
stays where it is, and one of mean curvature `H` moves inward by `w^2 H`: a ball of radius `r` by `w^2 / r`. So `t` is
chosen such that the enclosed volume is that of the voxels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Width of the Gaussian in parts of the largest distance of voxels. Steps of one voxel in a slanted wall have a wave
# length of that distance over the slope: with 0.6 the steepest keep exp(-2 (0.6 pi)^2) < 0.1 % of their height.
WIDTH = 0.6
# A boundary that needs a value outside of this range is one of walls about as thin as the Gaussian is wide: it is
# blurred half as much, down to this part of the width.
VALUES, LEAST_WIDTH = (0.25, 0.75), 0.2
# The grid of the boundary has at most so many cells along the longest side of a segment.
MOST_CELLS = 200
# Share of the volume to which it is kept, and attempts.
EXACT, ATTEMPTS = 5e-4, 6
# Padding in widths, beyond which a Gaussian has nothing, and in cells.
REACH, LEAST_PADDING = 4.0, 2


@dataclass(frozen=True, eq=False)
class Boundary:
    """Closed triangles around a mask.

    Attributes
    ----------
    vertices, faces
        (n, 3) m and (k, 3), outward.
    field, affine
        Blurred mask less its value at the boundary (nx, ny, nz), positive inside; and (4, 4) from its indices to m.
    voxel_volume, volume
        Of the voxels and within the triangles, m^3.
    width
        Standard deviation of the Gaussian, m; 0: not blurred.
    at_edge
        Whether the mask reaches the edge of the image, where the boundary is flat.

    """

    vertices: np.ndarray
    faces: np.ndarray
    field: np.ndarray
    affine: np.ndarray
    voxel_volume: float
    volume: float
    width: float
    at_edge: bool

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether points (k, 3), m, lie within, by the field."""
        return inside_field(self.field, self.affine, points)


def inside_field(field: np.ndarray, affine: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether points (k, 3), m, lie where a field is positive; beyond its grid they do not."""
    from scipy import ndimage

    indices = (points - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    return ndimage.map_coordinates(field, indices.T, order=1, mode="constant", cval=-1.0) > 0


def smooth_boundary(mask: np.ndarray, affine: np.ndarray) -> Boundary:
    """Boundary of a mask (nx, ny, nz) with a voxel at least; ``affine`` (4, 4) places voxels, m."""
    box = _box(mask)
    at_edge = any(s.start == 0 or s.stop == count for s, count in zip(box, mask.shape, strict=True))
    start = np.array([s.start for s in box])
    share, affine = _pooled(mask[box], _shifted(affine, start))
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    wanted = float(share.sum()) * abs(np.linalg.det(affine[:3, :3]))
    width = WIDTH * float(spacing.max())
    least = LEAST_WIDTH * width
    while True:
        made = _at_width(share, affine, wanted, width if width > least else 0.0)
        if made is not None or width <= least:
            break
        width /= 2
    vertices, faces, field, placed, volume = _any_value(share, affine, wanted) if made is None else made
    return Boundary(vertices, faces, field, placed, wanted, volume, width if made and width > least else 0.0, at_edge)


_Made = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]


def _box(mask: np.ndarray) -> tuple[slice, ...]:
    found = []
    for axis in range(3):
        there = np.flatnonzero(mask.any(axis=tuple(k for k in range(3) if k != axis)))
        found.append(slice(int(there[0]), int(there[-1]) + 1))
    return tuple(found)


def _shifted(affine: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Affine map of a grid that begins at an index, which need not be whole."""
    moved = affine.copy()
    moved[:3, 3] += affine[:3, :3] @ start
    return moved


def _pooled(mask: np.ndarray, affine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of blocks of voxels where these are finer than the grid of the boundary; the volume stays the same."""
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    cell = float((spacing * mask.shape).max()) / MOST_CELLS
    factors = np.maximum(1, np.floor(cell / spacing + 1e-9)).astype(int)
    share = mask.astype(np.float32)
    if (factors > 1).any():
        share = np.pad(share, [(0, -count % factor) for count, factor in zip(mask.shape, factors, strict=True)])
        parts = [n for count, factor in zip(share.shape, factors, strict=True) for n in (count // factor, factor)]
        share = share.reshape(parts).mean(axis=(1, 3, 5))
    affine = _shifted(affine, 0.5 * (factors - 1))
    affine[:3, :3] *= factors
    return share, affine


def _blurred(share: np.ndarray, affine: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Blur with a padding, on cells about as long along all axes."""
    from scipy import ndimage

    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    padding = np.ceil(REACH * width / spacing).astype(int) + LEAST_PADDING
    values = np.pad(share, [(int(p), int(p)) for p in padding])
    affine = _shifted(affine, -padding)
    if width == 0:
        return values, affine
    values = ndimage.gaussian_filter(values, width / spacing, mode="constant", truncate=REACH)
    # Between slices the blurred mask is smooth enough for cubic splines; a linear zero between them is not.
    cell = max(float(spacing.min()), float((spacing * share.shape).max()) / MOST_CELLS)
    counts = np.array(values.shape)
    finer = np.maximum(np.rint((counts - 1) * spacing / cell), counts - 1).astype(int) + 1
    if (finer > counts).any():
        values = ndimage.zoom(values, finer / counts, order=3, mode="nearest", grid_mode=False)
        affine = affine.copy()
        affine[:3, :3] *= (counts - 1) / (np.array(values.shape) - 1)
    return values, affine


def _at_width(share: np.ndarray, affine: np.ndarray, wanted: float, width: float) -> _Made | None:
    """Boundary that keeps the volume, by the secant method in the value; None where there is none of such a value."""
    values, placed = _blurred(share, affine, width)
    low, high = VALUES
    value, made = 0.5, None
    tried: list[tuple[float, float]] = []
    for _ in range(ATTEMPTS):
        made = _zero(values - np.float32(value), placed)
        if made is None:
            return None
        tried.append((value, made[-1] / wanted - 1.0))
        if abs(tried[-1][1]) < EXACT:
            return made
        if len(tried) == 1:
            value += np.clip(tried[0][1], -0.1, 0.1) * 0.5
        else:
            (a, at_a), (b, at_b) = tried[-2:]
            if at_a == at_b:
                return None
            value = b - at_b * (b - a) / (at_b - at_a)
        if not low <= value <= high:
            return None
    return made


def _any_value(share: np.ndarray, affine: np.ndarray, wanted: float) -> _Made:
    """Boundary of what is thinner than a few voxels: halfway between voxels, of whatever volume."""
    values, placed = _blurred(share, affine, 0.0)
    # Pooled voxels may all be less than half full.
    value = 0.5 * min(1.0, float(values.max()))
    made = _zero(values - np.float32(value), placed)
    assert made is not None, "the largest value is above its half"
    return made


def _zero(field: np.ndarray, affine: np.ndarray) -> _Made | None:
    """Triangles where a field is zero, outward, and their volume; None where it has one sign."""
    from skimage.measure import marching_cubes

    if not field.min() < 0 < field.max():
        return None
    # Zeros would give triangles without an area.
    field = np.where(np.abs(field) < 1e-6, np.float32(1e-6), field)
    vertices, faces, _, _ = marching_cubes(field, 0.0)
    vertices = vertices.astype(np.float64) @ affine[:3, :3].T + affine[:3, 3]
    corners = vertices[faces] - vertices.mean(axis=0)
    volume = float(np.einsum("ij,ij->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2])) / 6.0
    faces = faces.astype(np.int64)
    return vertices, faces if volume > 0 else faces[:, ::-1], field, affine, abs(volume)
