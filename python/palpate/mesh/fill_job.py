"""How a surface is to be filled, and an estimate of the number of elements, before it is filled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from palpate.errors import MeshError
from palpate.mesh.size import size_text
from palpate.units import share

if TYPE_CHECKING:
    import trimesh

Ball = tuple[tuple[float, float, float], float, float]
Element = Literal["linear", "quadratic"]  # with 4 and 10 nodes
Mesher = Literal["netgen", "wrap"]
Which = int | Literal["all"]

# Into so many parts the longest side is divided where no size is given. 10-node elements twice as large have as many
# nodes as the 4-node ones, and a smaller error.
PARTS = {"linear": 15.0, "quadratic": 7.5}
# Measured on the liver: so many elements lie in a cube as wide as the size asked for.
IN_CUBE = 3.5
# Filling so many takes an hour and more, and their factor more memory than a workstation has.
MOST_ELEMENTS = 5e6
# Of its bounding box, that a body fills at least, but for shells and vessels.
PART_OF_BOX = 0.1


@dataclass(frozen=True)
class FillOptions:
    """How a surface is filled."""

    # ``"netgen"`` on the surface itself, ``"wrap"``: a new surface around what the triangles enclose, filled by
    # fTetWild; None: NETGEN where the surface is closed, of one part, and not hard for it.
    mesher: Mesher | None = None
    part: Which = 1  # part of the solid by its rank in volume, from 1 on, or ``"all"``, for a surface that is wrapped
    max_volume_loss: float | str = 0.05  # share of the volume that a wrapped mesh may lose, or text such as ``"10%"``
    segments: tuple[str | int, ...] = ()  # names or labels of the segments of a label map

    def __post_init__(self) -> None:
        if self.mesher not in (None, "netgen", "wrap"):
            raise MeshError(f"mesher must be 'netgen' or 'wrap', got '{self.mesher}'")
        whole = isinstance(self.part, int) and not isinstance(self.part, bool) and self.part >= 1
        if not (whole or self.part == "all"):
            raise MeshError(f"part must be a number from 1 on or 'all', got '{self.part}'")
        object.__setattr__(self, "max_volume_loss", share(self.max_volume_loss))
        if not 0 <= float(self.max_volume_loss) < 1:
            raise MeshError(f"max_volume_loss must be at least 0 and below 1, got {self.max_volume_loss}")


@dataclass(frozen=True, eq=False)
class FillJob:
    """What every mesher is asked for."""

    element: Element  # what the surface is filled with
    size: float | None  # longest edge wanted, m; None: chosen by the shape
    refine: Sequence[Ball]  # finer balls
    options: FillOptions  # which mesher, which parts, and what may be lost
    time_limit: float  # of a mesher, s, in all its runs
    stage: Callable[[str], None]  # is called with the name of what is being done

    def size_in(self, extent: float) -> float:
        """Longest edge, m, in a body whose longest side is ``extent``, m."""
        return extent / PARTS[self.element] if self.size is None else self.size

    def balls(self, origin: np.ndarray, extent: float, unit: float) -> np.ndarray:
        """Finer balls (k, 5): centre and radius in a box at ``origin`` of a side ``extent``, m, size over ``unit``."""
        balls = [[*((np.array(c) - origin) / extent), r / extent, size / unit] for c, r, size in self.refine]
        return np.reshape(balls, (-1, 5))


def length_text(metres: float) -> str:
    """Write a length of elements."""
    return f"{1e3 * metres:.3g} mm"


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
