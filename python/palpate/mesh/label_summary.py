"""What a segmentation file holds, read by a process of its own: a damaged file ends that process alone."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from palpate.errors import MeshError
from palpate.input_file import require_file
from palpate.mesh.child import failure_of, run_limited

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

    Raises
    ------
    MeshError
        A file that cannot be read, or a segment that it does not have.

    """
    require_file(Path(path), MeshError)
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        job, summary_file = Path(folder) / "job.json", Path(folder) / "summary.json"
        wanted = None if segments is None else list(segments)
        job.write_text(json.dumps({"path": os.fspath(path), "unit": unit, "segments": wanted}))
        command = [sys.executable, "-m", "palpate.segmentation.summary_child", str(job), str(summary_file)]
        status = run_limited(command, time_limit)
        found = json.loads(summary_file.read_text()) if summary_file.exists() else {}
    if "reason" in found:
        raise MeshError(found["reason"])
    if status != 0 or "shape" not in found:
        failure = failure_of(status, time_limit) or "returned nothing"
        raise MeshError(f"{path}: the segmentation could not be read: its process {failure}")
    known = tuple(SegmentSummary(*segment) for segment in found["segments"])
    return LabelSummary(tuple(found["shape"]), tuple(found["spacing"]), found["voxel_volume"], known)
