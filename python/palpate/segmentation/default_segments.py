"""Segments of a label map that make a body by default: the largest, and those connected with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.segmentation.label_map import LabelMap, Segment

# Segments of fewer voxels are no part of a body by default, and more segments than this take long to fill.
LEAST_VOXELS, MOST_SEGMENTS = 64, 8
# Of a segment, at least this share hangs together with the largest.
CONNECTED = 0.5


def default_segments(labels: LabelMap) -> tuple[list[Segment], list[str]]:
    """Segments, the largest first, and the names of those that are left out."""
    from scipy import ndimage

    counts = {segment: int(np.count_nonzero(labels.mask(segment))) for segment in labels.segments}
    ordered = [s for s in sorted(labels.segments, key=lambda s: -counts[s]) if counts[s] >= LEAST_VOXELS]
    if not ordered:
        ordered = [max(labels.segments, key=lambda s: counts[s])]
    union = np.any([labels.mask(segment) for segment in ordered], axis=0)
    parts, _ = ndimage.label(union)
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
