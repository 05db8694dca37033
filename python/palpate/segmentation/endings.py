"""Endings of segmentation files."""

from __future__ import annotations

import os

SEGMENTATION_ENDINGS = (".nrrd", ".nii", ".nii.gz")


def is_segmentation(path: str | os.PathLike[str]) -> bool:
    """Whether the ending is that of a label map; `.seg.nrrd` is a `.nrrd`."""
    return os.fspath(path).lower().endswith(SEGMENTATION_ENDINGS)
