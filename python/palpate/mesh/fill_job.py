"""How a surface is to be filled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from palpate.errors import MeshError
from palpate.units import share

Ball = tuple[tuple[float, float, float], float, float]
Element = Literal["linear", "quadratic"]  # with 4 and 10 nodes
Mesher = Literal["netgen", "wrap"]
Which = int | Literal["all"]

# Into so many parts the longest side is divided where no size is given. 10-node elements twice as large have as many
# nodes as the 4-node ones, and a smaller error.
PARTS = {"linear": 15.0, "quadratic": 7.5}


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


def length_text(metres: float) -> str:
    """Write a length of elements."""
    return f"{1e3 * metres:.3g} mm"
