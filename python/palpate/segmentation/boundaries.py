"""Segments that make a body by default, and boundaries of chosen ones: around all, and around each among the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from palpate.errors import MeshError
from palpate.segmentation.label_map import LabelMap, Segment
from palpate.segmentation.smoothing import Boundary, smooth_boundary

# A segment is covered by at most so many balls, each of so many times its thickness there.
MOST_BALLS, COVER = 48, 2.4
# A segment that was not chosen is named if this share of it lies in a cavity of those that were.
IN_CAVITY = 0.5
# Segments of fewer voxels are no part of a body by default, and more segments than this take long to fill.
LEAST_VOXELS, MOST_SEGMENTS = 64, 8
# Of a segment, at least this share hangs together with the largest.
CONNECTED = 0.5


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Boundaries of segments."""

    segments: tuple[Segment, ...]
    whole: Boundary  # around all voxels of the chosen segments
    # Of each chosen segment but ``rest``, in the order in which they were given: where two overlap, the later counts.
    inner: dict[int, Boundary]
    rest: int  # rank of the largest segment, which is what the others leave of the whole
    volumes: list[float]  # of the voxels of each chosen segment, less those that another counts, m^3
    # Segments that were not chosen and lie in cavities of the whole, with their volumes, m^3.
    in_cavities: list[tuple[str, float]]


def boundaries(labels: LabelMap, wanted: Sequence[str | int]) -> Boundaries:
    """Boundaries of segments by their names.

    Raises MeshError for a segment that is not there, that has no voxel, or that later ones cover.
    """
    segments = labels.choose(wanted)
    masks = [labels.mask(segment) for segment in segments]
    for segment, mask in zip(segments, masks, strict=True):
        if not mask.any():
            raise MeshError(f"{labels.name}: segment '{segment.name}' is empty: no voxel has its label")
    counts = [int(np.count_nonzero(mask)) for mask in masks]
    rest = int(np.argmax(counts))
    union = masks[rest].copy()
    others = [rank for rank in range(len(segments)) if rank != rest]
    taken = np.zeros_like(union)
    inner, own = {}, [0] * len(segments)
    for rank in reversed(others):
        left = masks[rank] & ~taken
        own[rank] = int(np.count_nonzero(left))
        if own[rank] == 0:
            raise MeshError(f"{labels.name}: segment '{segments[rank].name}' is covered by those after it")
        taken |= left
        union |= left
        inner[rank] = smooth_boundary(left, labels.affine)
    own[rest] = counts[rest] - int(np.count_nonzero(masks[rest] & taken))
    volumes = [count * labels.voxel_volume for count in own]
    ordered = dict(sorted(inner.items()))
    cavities = _in_cavities(labels, segments, union)
    return Boundaries(segments, smooth_boundary(union, labels.affine), ordered, rest, volumes, cavities)


def _in_cavities(labels: LabelMap, chosen: tuple[Segment, ...], union: np.ndarray) -> list[tuple[str, float]]:
    cavity = scipy.ndimage.binary_fill_holes(union) & ~union
    if not cavity.any():
        return []
    found = []
    for segment in labels.segments:
        if segment in chosen:
            continue
        mask = labels.mask(segment)
        count = int(np.count_nonzero(mask))
        if count and np.count_nonzero(mask & cavity) > IN_CAVITY * count:
            found.append((segment.name, count * labels.voxel_volume))
    return found


def covering_balls(boundary: Boundary) -> np.ndarray:
    """Balls (k, 5) over a segment: centre (3), radius, and half of the thickness there, m; the thickest come first."""
    spacing = np.linalg.norm(boundary.affine[:3, :3], axis=0)
    depth = scipy.ndimage.distance_transform_edt(boundary.field > 0, sampling=spacing)
    places = np.argwhere(depth > 0)
    depths = depth[tuple(places.T)]
    points = places @ boundary.affine[:3, :3].T + boundary.affine[:3, 3]
    balls = []
    while len(points) and len(balls) < MOST_BALLS:
        deepest = int(depths.argmax())
        reach = COVER * max(depths[deepest], float(spacing.max()))
        balls.append([*points[deepest], reach, depths[deepest]])
        left = np.linalg.norm(points - points[deepest], axis=1) > reach
        points, depths = points[left], depths[left]
    return np.array(balls).reshape(-1, 5)


def default_segments(labels: LabelMap) -> tuple[list[Segment], list[str]]:
    """Segments, the largest first, and the names of those that are left out."""
    counts = {segment: labels.count(segment) for segment in labels.segments}
    ordered = [s for s in sorted(labels.segments, key=lambda s: -counts[s]) if counts[s] >= LEAST_VOXELS]
    if not ordered:
        ordered = [max(labels.segments, key=lambda s: counts[s])]
    union = np.any([labels.mask(segment) for segment in ordered], axis=0)
    parts, _ = scipy.ndimage.label(union)
    body = parts == np.bincount(parts[labels.mask(ordered[0])]).argmax()
    chosen = []
    for segment in ordered:
        mask = labels.mask(segment)
        inside = np.count_nonzero(mask & body) >= CONNECTED * counts[segment]
        # One that says the same as another, in another layer, would cover it.
        if inside and len(chosen) < MOST_SEGMENTS and not _same(labels, chosen, mask):
            chosen.append(segment)
    return chosen, [segment.name for segment in labels.segments if segment not in chosen]


def _same(labels: LabelMap, chosen: Sequence[Segment], mask: np.ndarray) -> bool:
    return any(np.array_equal(labels.mask(segment), mask) for segment in chosen)


def selectors(labels: LabelMap, segments: Sequence[Segment]) -> list[str]:
    """Names by which segments are chosen, or their labels where names are not unique."""
    names = [segment.name.lower() for segment in labels.segments]
    return [s.name if names.count(s.name.lower()) == 1 else str(s.value) for s in segments]
