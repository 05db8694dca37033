"""Summary of a segmentation, read in a process of its own: ``python -m ... JOB.json RESULT.json``.

Exit status 1: the reason is ``reason`` of the result.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from palpate._native import end_with_parent
from palpate.errors import Error
from palpate.segmentation.reading import load_label_map


def main(job: str, summary_file: str) -> int:
    """Write what a label map holds; segments that the job names must be there."""
    given = json.loads(Path(job).read_text())
    try:
        labels = load_label_map(given["path"], given["unit"])
        if given["segments"] is not None:
            labels.choose(given["segments"])
    except Error as error:
        return _write(summary_file, {"reason": str(error)}, 1)
    except MemoryError:
        return _write(summary_file, {"reason": f"{given['path']}: there is not enough memory for its voxels"}, 1)
    segments = [[s.name, s.value, int(np.count_nonzero(labels.mask(s)))] for s in labels.segments]
    shape, spacing = list(labels.layers.shape[1:]), labels.spacing.tolist()
    found = {"shape": shape, "spacing": spacing, "voxel_volume": labels.voxel_volume, "segments": segments}
    return _write(summary_file, found, 0)


def _write(summary_file: str, found: dict[str, Any], status: int) -> int:
    Path(summary_file).write_text(json.dumps(found))
    return status


if __name__ == "__main__":
    end_with_parent()
    sys.exit(main(*sys.argv[1:3]))
