"""Reading and smoothing of a segmentation in a process of its own: ``python -m ... JOB.json RESULT.npz``.

Files may be damaged or made to harm; a crash of a library ends this process alone. Exit status 1: the reason is
``reason`` of the result, after the file's name.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from palpate._native import end_with_parent
from palpate.errors import Error
from palpate.segmentation.boundaries import Boundaries, boundaries, covering_balls
from palpate.segmentation.reading import load_label_map


def main(job: str, boundaries_file: str) -> int:
    """Write the boundaries of the segments that a job names."""
    given = json.loads(Path(job).read_text())
    try:
        labels = load_label_map(given["path"], given["unit"])
        found = boundaries(labels, given["segments"])
    except Error as error:
        np.savez(boundaries_file, reason=str(error))
        return 1
    except MemoryError:
        np.savez(boundaries_file, reason=f"{given['path']}: there is not enough memory for its voxels")
        return 1
    np.savez(boundaries_file, spacing=labels.spacing, **_arrays(found))
    return 0


def _arrays(found: Boundaries) -> dict[str, np.ndarray]:
    whole, titles = found.whole, [segment.name for segment in found.segments]
    # Segments of one name, chosen by their labels, have the labels in the names of their regions.
    names = [s.name if titles.count(s.name) == 1 else f"{s.name} ({s.value})" for s in found.segments]
    arrays = {
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
        arrays |= {
            f"vertices_{rank}": boundary.vertices,
            f"faces_{rank}": boundary.faces,
            f"field_{rank}": boundary.field,
            f"affine_{rank}": boundary.affine,
            f"smoothed_{rank}": np.array([boundary.volume, boundary.width]),
            f"balls_{rank}": covering_balls(boundary),
        }
    return arrays


if __name__ == "__main__":
    end_with_parent()
    sys.exit(main(*sys.argv[1:3]))
