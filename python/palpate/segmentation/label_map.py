"""Label maps: an integer for each voxel, an affine map to patient axes, and named segments."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.errors import MeshError

# So many names are listed in a message.
MOST_NAMED = 20
# Bytes of voxels that are read: a CT of the whole body, 512 x 512 x 2000 of two bytes, has 1e9.
MOST_BYTES = 4 << 30


@dataclass(frozen=True)
class Segment:
    """A name, and the voxels that belong to it: those of ``layer`` whose label is ``value``."""

    name: str
    value: int
    layer: int = 0


@dataclass(frozen=True, eq=False)
class LabelMap:
    """Labels of a file."""

    name: str  # of the file in messages
    # (layers, nx, ny, nz) integers. Segments of different layers may overlap.
    layers: np.ndarray
    # (4, 4): from indices of voxels to positions of their centres, m. The axes are those of the patient: x to the
    # right, y to the front (anterior), z to the head (superior), RAS in short.
    affine: np.ndarray
    segments: tuple[Segment, ...]  # in the order of the file

    @property
    def spacing(self) -> np.ndarray:
        """Distances of voxels along the three axes of the array, (3,) m."""
        return np.linalg.norm(self.affine[:3, :3], axis=0)

    @property
    def voxel_volume(self) -> float:
        """Volume of a voxel, m^3."""
        return float(abs(np.linalg.det(self.affine[:3, :3])))

    def mask(self, segment: Segment) -> np.ndarray:
        """Voxels (nx, ny, nz) of a segment."""
        return self.layers[segment.layer] == segment.value

    def count(self, segment: Segment) -> int:
        """How many voxels a segment has."""
        return int(np.count_nonzero(self.mask(segment)))

    def find(self, wanted: str | int) -> Segment:
        """Find a segment by its name, or by its label where no name fits.

        Letters may be large or small if only one name fits then. Raises MeshError, with the names in the file, if there
        is none, or if there are several.
        """
        text = str(wanted)
        exact = [s for s in self.segments if s.name == text]
        loose = [s for s in self.segments if s.name.lower() == text.lower()]
        by_label = [s for s in self.segments if text.isascii() and text.isdigit() and s.value == int(text)]
        found = exact or loose or by_label
        if len(found) == 1:
            return found[0]
        if found:
            raise MeshError(f"{self.name}: {len(found)} segments fit '{text}'; {self.names_text()}")
        near = difflib.get_close_matches(text, [s.name for s in self.segments], 1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise MeshError(f"{self.name}: has no segment '{text}'; {hint}{self.names_text()}")

    def choose(self, wanted: Sequence[str | int]) -> tuple[Segment, ...]:
        """Find several segments; without a name the only one of the file.

        Raises MeshError for a segment that is not there or is given twice, or no name where the file has several.
        """
        if not wanted:
            if len(self.segments) == 1:
                return self.segments
            raise MeshError(f"{self.name}: give a segment by --segment, or [[body.segment]]; {self.names_text()}")
        chosen = tuple(self.find(name) for name in wanted)
        twice = next((s for rank, s in enumerate(chosen) if s in chosen[:rank]), None)
        if twice is not None:
            raise MeshError(f"{self.name}: segment '{twice.name}' is given twice")
        return chosen

    def names_text(self) -> str:
        """List the names for a message."""
        shown = ", ".join(f"'{s.name}'" for s in self.segments[:MOST_NAMED])
        more = len(self.segments) - MOST_NAMED
        return f"the file has {shown}{f' and {more} more' if more > 0 else ''}"


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
    size = math.prod(map(int, sizes), start=dtype.itemsize)
    if size > MOST_BYTES:
        raise MeshError(
            f"{path}: {' x '.join(map(str, sizes))} voxels take {size / 2**30:.3g} GiB, more than the "
            f"{MOST_BYTES >> 30} GiB that are read; crop the image around the segments"
        )
