"""Summary of a segmentation file: its voxels and segments."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from palpate.mesh.label_process import label_arrays

TIME_LIMIT = 300.0  # s


@dataclass(frozen=True)
class SegmentSummary:
    """A segment: its name, its label, and how many voxels it has."""

    name: str
    value: int
    voxels: int


@dataclass(frozen=True)
class LabelSummary:
    """A label map: voxels along its axes, their distances, m, their volume, m^3, and its segments."""

    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    voxel_volume: float
    segments: tuple[SegmentSummary, ...]


def label_summary(
    path: str | os.PathLike[str],
    unit: str | None = None,
    segments: Sequence[str | int] | None = None,
    time_limit: float = TIME_LIMIT,
) -> LabelSummary:
    """Summary of a segmentation, with the bounds of filling it; ``segments`` are looked for.

    Raises MeshError for a file that cannot be read, or a segment that it does not have.
    """
    found = label_arrays("summary", path, unit, segments, time_limit)
    rows = zip(*(found[name].tolist() for name in ("names", "values", "voxels")), strict=True)
    shape, spacing = tuple(found["shape"].tolist()), tuple(found["spacing"].tolist())
    return LabelSummary(shape, spacing, float(found["voxel_volume"]), tuple(SegmentSummary(*row) for row in rows))
