"""Parts of the body: ``[[region]]`` has a material of its own, ``[touch]`` may be touched, or is computed first."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Tag, field_validator, model_validator

from palpate.body import Material, SurfaceRegion, parse
from palpate.errors import MeshError
from palpate.mesh import TetMesh, shapes
from palpate.scene.table import (
    Density,
    Direction,
    Length,
    Point,
    PoissonsRatio,
    Pressure,
    Table,
    explained,
    is_whole,
    one_of,
)

# The solid of each shape, and the keys that place it.
SHAPES = {
    "sphere": (shapes.Sphere, ("center", "radius")),
    "box": (shapes.Box, ("low", "high")),
    "cylinder": (shapes.Cylinder, ("start", "end", "radius")),
    "half-space": (shapes.HalfSpace, ("point", "normal")),
}
PLACES = tuple(dict.fromkeys(key for _, keys in SHAPES.values() for key in keys))


_SEGMENT = one_of("the name or the label of a segment", lambda v: (isinstance(v, str) and v != "") or is_whole(v))

_REGION = one_of("the number or the name of a region", lambda v: v is None or isinstance(v, str) or is_whole(v))


Law = Literal["linear", "neo-hookean", "mooney-rivlin", "yeoh"]

# Young's modulus, Pa, and law of a scene that gives none. At small strain the law is linear elasticity.
DEFAULT_MODULUS = 10e3
DEFAULT_LAW: Law = "neo-hookean"
# Laws whose constants give the modulus, and those constants.
LAWS_OF_CONSTANTS, CONSTANTS = ("mooney-rivlin", "yeoh"), {"c10", "c01", "c20", "c30"}


class MaterialTable(Table):
    """Isotropic material of the whole body, but for its regions."""

    youngs_modulus: Pressure = DEFAULT_MODULUS
    """Young's modulus."""
    poissons_ratio: PoissonsRatio = 0.45
    """Poisson's ratio, below 0.5."""
    density: Density = 1000.0
    """Density, for weight and motion."""
    law: Law = DEFAULT_LAW
    """Constitutive law: linear elasticity, or a hyperelastic one for strains beyond about 10 %."""
    c10: Pressure | None = None
    """First constant of `mooney-rivlin` and `yeoh`, as Abaqus and CalculiX define it."""
    c01: Pressure | None = None
    """Second constant of `mooney-rivlin`."""
    c20: Pressure | None = None
    """Second constant of `yeoh`."""
    c30: Pressure | None = None
    """Third constant of `yeoh`."""

    @model_validator(mode="after")
    def _one_material(self) -> MaterialTable:
        with explained():
            self.material()
        return self

    def material(self) -> Material:
        """As the rest of the package knows it."""
        return _material({name: getattr(self, name) for name in self.model_fields_set})


class PlaceTable(Table):
    """A part of the body: a region of the mesh file by number or name, or what lies in a shape."""

    mesh_region: Annotated[int | str | None, _REGION] = None
    """Region of the mesh file, by its number or name."""
    shape: Literal["sphere", "box", "cylinder", "half-space"] | None = None
    """Shape that contains the centroids of the elements."""
    center: Point | None = None
    """Centre of a sphere."""
    radius: Length | None = None
    """Radius of a sphere or a cylinder."""
    low: Point | None = None
    """Lower corner of a box."""
    high: Point | None = None
    """Upper corner of a box."""
    start: Point | None = None
    """Start of the axis of a cylinder."""
    end: Point | None = None
    """End of the axis of a cylinder."""
    point: Point | None = None
    """Point on the plane of a half-space."""
    normal: Direction | None = None
    """Normal of the plane, out of the half-space."""

    @model_validator(mode="after")
    def _one_place(self) -> PlaceTable:
        if (self.shape is None) == (self.mesh_region is None):
            raise ValueError("give either a shape or a mesh_region")
        needed = () if self.shape is None else SHAPES[self.shape][1]
        for key in PLACES:
            given = getattr(self, key) is not None
            if given and key not in needed:
                raise ValueError(f"'{key}' does not belong to a {self.shape or 'mesh_region'}")
            if not given and key in needed:
                raise ValueError(f"a {self.shape} needs {' and '.join(needed)}: '{key}' is missing")
        if self.shape is not None:
            self.solid()
        return self

    @property
    def title(self) -> str:
        """What the region is called: as in the mesh file, or by its shape."""
        if isinstance(self.mesh_region, int):
            return f"region {self.mesh_region}"
        return self.mesh_region or str(self.shape)

    def solid(self) -> shapes.Shape:
        """Solid of a shape."""
        kind, keys = SHAPES[str(self.shape)]
        with explained():
            return kind(*(getattr(self, key) for key in keys))

    def elements(self, mesh: TetMesh) -> np.ndarray:
        """Mask of the elements (m,) of this region; MeshError if there are none."""
        if self.shape is not None:
            return shapes.elements_inside(self.solid(), mesh.nodes, mesh.tets)
        members = mesh.regions == mesh.region_names.get(str(self.mesh_region), self.mesh_region)
        if not members.any():
            known = [*map(str, sorted(set(mesh.regions.tolist()))), *mesh.region_names]
            raise MeshError(f"the mesh has no region {self.mesh_region}; it has {', '.join(known)}")
        return members


class PartMaterialTable(Table):
    """Material of a part of the body; what it does not give is that of ``[material]``."""

    youngs_modulus: Pressure | None = None
    """Young's modulus of the part; constants of `[material]` are scaled to it. Default: that of `[material]`."""
    poissons_ratio: PoissonsRatio | None = None
    """Poisson's ratio of the part, below 0.5. Default: that of `[material]`."""
    density: Density | None = None
    """Density of the part, for weight and motion. Default: that of `[material]`."""
    law: Law | None = None
    """Constitutive law: linear elasticity, or a hyperelastic one for strains beyond about 10 %. Default: that of
    `[material]`."""
    c10: Pressure | None = None
    """First constant of `mooney-rivlin` and `yeoh`, as Abaqus and CalculiX define it. Default: that of `[material]`."""
    c01: Pressure | None = None
    """Second constant of `mooney-rivlin`. Default: that of `[material]`."""
    c20: Pressure | None = None
    """Second constant of `yeoh`. Default: that of `[material]`."""
    c30: Pressure | None = None
    """Third constant of `yeoh`. Default: that of `[material]`."""

    def material(self, base: MaterialTable) -> Material:
        """Material, completed from that of the body."""
        return _completed(self, base)


class RegionTable(PartMaterialTable, PlaceTable):
    """A material for part of the body. Later tables override earlier ones."""


class _NamedSegment(Table):
    name: Annotated[int | str, _SEGMENT]
    """Name of the segment in the file, or its label."""


class SegmentTable(PartMaterialTable, _NamedSegment):
    """A segment of a label map, and its material."""


def _completed(table: PartMaterialTable, base: MaterialTable) -> Material:
    given = {name: getattr(base, name) for name in base.model_fields_set}
    own = {name: getattr(table, name) for name in MaterialTable.model_fields if getattr(table, name) is not None}
    if "law" in own:
        # Constants belong to a law.
        given = {
            name: value for name, value in given.items() if name in ("poissons_ratio", "density", "youngs_modulus")
        }
        if own["law"] in LAWS_OF_CONSTANTS:
            given.pop("youngs_modulus", None)
    elif given.get("law") in LAWS_OF_CONSTANTS and "youngs_modulus" in own and not own.keys() & CONSTANTS:
        # The same rubber, but stiffer or softer.
        share = own.pop("youngs_modulus") / _material(given).youngs_modulus
        own |= {name: share * value for name, value in given.items() if name in CONSTANTS}
    return _material(given | own)


def _material(given: dict[str, Any]) -> Material:
    """Return the material of what is given; laws without constants of their own have the default modulus."""
    given = {"law": DEFAULT_LAW} | given
    if given["law"] in ("linear", "neo-hookean"):
        given = {"youngs_modulus": DEFAULT_MODULUS} | given
    return Material(**given)


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
    """Where the body may be touched, and what of it is computed first: the rest follows beside the force loop."""

    region: _Area | None = None
    """Part of the surface that may be touched: a predicate, the name of a region of the mesh file, node numbers, or
    a shape. Default: all of it."""
    first: _Area | None = None
    """Part of the region that is computed first. `palpate run` opens when it is ready."""

    @field_validator("region", "first")
    @classmethod
    def _readable(cls, area: Any) -> Any:
        # A word alone names a region of the mesh file, which has not been read yet.
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
