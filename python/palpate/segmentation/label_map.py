"""Label maps: an integer for each voxel, an affine map to patient axes, and named segments."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.errors import MeshError

# So many names are listed in a message.
MOST_NAMED = 20


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
