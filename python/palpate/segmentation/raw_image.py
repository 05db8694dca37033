"""Voxels of a file with their place, before they are taken for labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.errors import MeshError
from palpate.segmentation.label_map import Segment

# Bytes of voxels that are read: a CT of the whole body, 512 x 512 x 2000 of two bytes, has 1e9.
MOST_BYTES = 4 << 30


@dataclass(frozen=True, eq=False)
class RawImage:
    """Voxels as they stand in a file."""

    layers: np.ndarray  # (layers, nx, ny, nz) numbers of any kind
    affine: np.ndarray  # (4, 4) from indices to right, anterior, superior, in the file's unit
    unit: str | None  # unit of length that the file names; None: none
    segments: tuple[Segment, ...] | None  # segments that the file names; None: none


def require_size(path: Path, sizes: Sequence[int], dtype: np.dtype) -> None:
    """Refuse an image that is too large by its header, before anything of it is read.

    Raises MeshError for more than ``MOST_BYTES``.
    """
    size = dtype.itemsize
    for count in sizes:
        size *= int(count)
    if size > MOST_BYTES:
        raise MeshError(
            f"{path}: {' x '.join(map(str, sizes))} voxels take {size / 2**30:.3g} GiB, more than the "
            f"{MOST_BYTES >> 30} GiB that are read; crop the image around the segments"
        )
