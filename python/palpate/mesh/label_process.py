"""A segmentation file is read by a process of its own: a damaged file ends that process alone."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.errors import MeshError
from palpate.input_file import require_file
from palpate.mesh.child import failure_of, run_limited

TIME_LIMIT = 300.0  # s


def label_arrays(
    content: str,
    path: str | os.PathLike[str],
    unit: str | None,
    segments: Sequence[str | int] | None,
    time_limit: float,
) -> dict[str, np.ndarray]:
    """``summary`` or ``boundaries`` of a segmentation, by :mod:`palpate.segmentation.child`.

    Raises MeshError for a file that cannot be read, or a segment that it does not have.
    """
    require_file(Path(path), MeshError)
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        job, result = Path(folder) / "job.json", Path(folder) / "result.npz"
        wanted = None if segments is None else list(segments)
        job.write_text(json.dumps({"path": os.fspath(path), "unit": unit, "segments": wanted}))
        command = [sys.executable, "-m", "palpate.segmentation.child", content, str(job), str(result)]
        status = run_limited(command, time_limit)
        arrays: dict[str, np.ndarray] = {}
        # A process that was stopped may have left part of the file.
        if status in (0, 1) and result.exists():
            with np.load(result) as found:
                arrays = dict(found)
    if "reason" in arrays:
        raise MeshError(str(arrays["reason"]))
    if status != 0:
        failure = failure_of(status, time_limit) or "returned nothing"
        raise MeshError(f"{path}: the segmentation could not be read: its process {failure}")
    return arrays


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
