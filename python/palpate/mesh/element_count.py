"""Estimate of the number of elements that fill a body, before it is filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError
from palpate.mesh.fill_job import FillJob, length_text
from palpate.mesh.size import size_text

if TYPE_CHECKING:
    import trimesh

# Measured on the liver: so many elements lie in a cube as wide as the size asked for.
IN_CUBE = 3.5
# Filling so many takes an hour and more, and their factor more memory than a workstation has.
MOST_ELEMENTS = 5e6
# Of its bounding box, that a body fills at least, but for shells and vessels.
PART_OF_BOX = 0.1


def require_fitting_size(name: str, shape: trimesh.Trimesh, job: FillJob) -> None:
    """Refuse elements larger than the surface (m), or so small that there would be millions of them; MeshError."""
    if job.size is None or len(shape.vertices) == 0:
        return
    extents = np.ptp(shape.vertices, axis=0)
    if not np.isfinite(extents).all():
        return
    if job.size > extents.max():
        raise MeshError(
            f"{name}: elements of {size_text([job.size])} (--max-size, max_element_size) are larger than the body of "
            f"{size_text(extents)}: give metres, or text such as '4mm'"
        )
    # What an open surface encloses is not known yet.
    volume = abs(float(shape.volume)) if shape.is_watertight else PART_OF_BOX * float(extents.prod())
    count = IN_CUBE * volume / job.size**3
    if count > MOST_ELEMENTS:
        least = (IN_CUBE * volume / MOST_ELEMENTS) ** (1 / 3)
        raise MeshError(
            f"{name}: elements of {length_text(job.size)} (--max-size, max_element_size) would be about {count:.2g}, "
            f"more than {MOST_ELEMENTS / 1e6:g} million: give at least {length_text(least)}"
        )
