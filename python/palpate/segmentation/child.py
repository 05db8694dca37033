"""A segmentation in a process of its own: ``python -m palpate.segmentation.child CONTENT JOB.json RESULT.npz``.

CONTENT is ``summary``, what the file holds, or ``boundaries``, which are smoothed. Files may be damaged or made to
harm; a crash of a library ends this process alone. Exit status 1: the reason is ``reason`` of the result, after the
file's name.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate._native import end_with_parent
from palpate.errors import Error
from palpate.segmentation.boundaries import boundaries, covering_balls
from palpate.segmentation.label_map import LabelMap
from palpate.segmentation.reading import load_label_map


def main(content: str, job: str, result: str) -> int:
    """Write the content of a label map, for the segments that the job names."""
    given = json.loads(Path(job).read_text())
    try:
        arrays = CONTENTS[content](load_label_map(given["path"], given["unit"]), given["segments"])
    except Error as error:
        arrays = {"reason": str(error)}
    except MemoryError:
        arrays = {"reason": f"{given['path']}: there is not enough memory for its voxels"}
    np.savez(result, **arrays)
    return int("reason" in arrays)


def _summary(labels: LabelMap, segments: Sequence[str | int] | None) -> dict[str, Any]:
    """Size of a label map, and its segments; those that are named must be there."""
    if segments is not None:
        labels.choose(segments)
    return {
        "shape": labels.layers.shape[1:],
        "spacing": labels.spacing,
        "voxel_volume": labels.voxel_volume,
        "names": np.array([s.name for s in labels.segments], dtype=str),
        "values": [s.value for s in labels.segments],
        "voxels": [labels.count(s) for s in labels.segments],
    }


def _boundaries(labels: LabelMap, segments: Sequence[str | int]) -> dict[str, Any]:
    """Boundaries of segments."""
    found = boundaries(labels, segments)
    whole, titles = found.whole, [segment.name for segment in found.segments]
    # Segments of one name, chosen by their labels, have the labels in the names of their regions.
    names = [s.name if titles.count(s.name) == 1 else f"{s.name} ({s.value})" for s in found.segments]
    arrays = {
        "spacing": labels.spacing,
        "names": np.array(names),
        "volumes": np.array(found.volumes),
        "rest": np.array(found.rest),
        "whole": np.array([whole.voxel_volume, whole.volume, whole.width]),
        "at_edge": np.array(whole.at_edge),
        "vertices": whole.vertices,
        "faces": whole.faces,
        "cavity_names": np.array([name for name, _ in found.in_cavities], dtype=str),
        "cavity_volumes": np.array([volume for _, volume in found.in_cavities], dtype=float),
    }
    for rank, boundary in found.inner.items():
        arrays |= {f"{name}_{rank}": getattr(boundary, name) for name in ("vertices", "faces", "field", "affine")}
        arrays[f"balls_{rank}"] = covering_balls(boundary)
    return arrays


CONTENTS = {"summary": _summary, "boundaries": _boundaries}


if __name__ == "__main__":
    end_with_parent()
    sys.exit(main(*sys.argv[1:4]))
