"""``[touch]``: the touchable part of the surface, and the part that is computed first."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Tag, field_validator

from palpate.body import SurfaceRegion, parse
from palpate.mesh import TetMesh
from palpate.scene.regions import PlaceTable
from palpate.scene.table import Table, explained, is_whole, one_of


def _kind(value: Any) -> str:
    # Names that no key of a table has: they are left out of the place of a mistake.
    return "[place]" if isinstance(value, (dict, PlaceTable)) else "[text]" if isinstance(value, str) else "[nodes]"


def _is_nodes(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and all(map(is_whole, value))


_Named = Annotated[
    Annotated[str, Tag("[text]")] | Annotated[list[int], Tag("[nodes]")] | Annotated[PlaceTable, Tag("[place]")],
    Discriminator(_kind),
]
_Area = Annotated[
    _Named,
    one_of(
        "a predicate, such as 'z > 3cm', the name of a region of the mesh file, a list of node numbers, or a table of "
        "a shape, such as { shape = 'sphere', center = ['0mm', '0mm', '40mm'], radius = '2cm' }",
        lambda v: isinstance(v, (str, dict, PlaceTable)) or _is_nodes(v),
    ),
]


class TouchTable(Table):
    """Where the body may be touched; what is left out is the whole surface.

    ``first`` is computed before the rest. `palpate run` opens when it is ready, and goes on with the rest beside the
    force loop.
    """

    region: _Area | None = None
    """Part of the surface that may be touched: a predicate, the name of a region of the mesh file, node numbers, or
    a shape. Default: all of it."""
    first: _Area | None = None
    """Part of the region that is computed first. `palpate run` opens when it is ready."""

    @field_validator("region", "first")
    @classmethod
    def _readable(cls, area: Any) -> Any:
        # A word alone is the name of a region, of which only the mesh file knows.
        if isinstance(area, str) and any(sign in area for sign in "<>="):
            with explained():
                parse(area)
        return area

    def areas(self, mesh: TetMesh) -> dict[str, SurfaceRegion | None]:
        """Arguments ``touch`` and ``first`` of :func:`palpate.precompute`; ``mesh`` has the regions of the file.

        Raises MeshError for a region that the file does not have.
        """
        return {"touch": _area(self.region, mesh), "first": _area(self.first, mesh)}


def _area(named: Any, mesh: TetMesh) -> SurfaceRegion | None:
    if isinstance(named, str) and named in mesh.region_names:
        named = PlaceTable(mesh_region=named)
    if not isinstance(named, PlaceTable):
        return named
    if named.shape is not None:
        return named.solid()
    mask = np.zeros(len(mesh.nodes), dtype=bool)
    mask[mesh.tets[named.elements(mesh)]] = True
    return mask
