"""Tables of the scene file: bodies, supports, tools, which device moves each of them, the view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, field_validator, model_validator

from palpate import models
from palpate.body import Material, parse
from palpate.fields import STRAIN_LIMIT
from palpate.mesh import TetMesh
from palpate.mesh.fill_job import Element, FillOptions, Mesher
from palpate.mesh.surface_file import SURFACE_ENDINGS
from palpate.scene.devices import KINDS, LOOP_KEYS, DeviceTable
from palpate.scene.dynamics import DynamicsTable
from palpate.scene.files import is_node_file
from palpate.scene.loads import LoadTable
from palpate.scene.regions import MaterialTable, RegionTable, SegmentTable, TouchTable
from palpate.scene.table import (
    Length,
    Orientation,
    Point,
    Pressure,
    Radius,
    Share,
    Table,
    TableError,
    explained,
    is_whole,
    one_of,
)
from palpate.scene.tool_shape import ShapeTable
from palpate.segmentation.endings import SEGMENTATION_ENDINGS, is_segmentation
from palpate.units import length_scale

# As many as the force loop takes.
MOST_BODIES, MOST_TOOLS = 4, 4
# Rubber on dry glass comes to about 2; beyond this a coefficient is a slip of the pen.
MOST_FRICTION = 10.0


_NODES = one_of(
    "a predicate, such as 'z < min + 5mm', a list of node numbers, or a file of them, such as 'liver.nodes'",
    lambda v: v is None or isinstance(v, str) or (isinstance(v, (list, tuple)) and all(map(is_whole, v))),
)

_PART = one_of("a number from 1 on, or 'all'", lambda v: is_whole(v, 1) or v == "all")


class RefineTable(Table):
    """A ball of finer elements in a mesh made from a surface."""

    center: Point
    """Centre of the ball."""
    radius: Length
    """Radius of the ball."""
    size: Length
    """Longest edge of an element in the ball."""


class SupportsTable(Table):
    """Where the body is fixed: a predicate over x, y, z, node indices, or a file of them; a model has its own."""

    fixed: Annotated[str | list[int] | None, _NODES] = None
    """Nodes that do not move: a predicate over `x`, `y`, `z`, `min` and `max`, such as `"z < min + 5mm"`, a list of
    node numbers, or a file of them. A built-in model has supports of its own."""

    @field_validator("fixed")
    @classmethod
    def _readable(cls, fixed: Any) -> Any:
        if isinstance(fixed, str) and not is_node_file(fixed):
            with explained():
                parse(fixed)
        return fixed


class BodyTable(Table):
    """A solid, one of: a mesh file (volume, surface or segmentation to be filled), a built-in model, a store.

    Paths are relative to the scene file. ``element = "quadratic"`` gives 4-node tetrahedra of volume meshes and models
    the middles of their edges as nodes. Supports listed by node then fix the middles between them. ``mesher``, ``part``
    and ``max_volume_loss`` are those of :func:`palpate.tetrahedralize`. ``segment`` names parts of a label map, which
    become regions with their names. Predicates and shapes speak of the body's own frame.
    """

    name: str | None = None
    """Name in messages and on the page. Default: the model, or the file."""
    mesh: str | None = None
    """Volume mesh, or a surface or segmentation to fill. The path is relative to the scene file."""
    model: str | None = None
    """Built-in model: `doll`, `kidney`, `liver` or `beam`."""
    store: str | None = None
    """Precomputed `.palpate` file. It contains material, supports and loads."""
    paper: bool = False
    """Whether the model has the size and mesh of the paper."""
    unit: str | None = None
    """Unit of length of the file. Default: m; for a segmentation that of the file, or mm. A body below 1 mm or above
    3 m is then refused."""
    max_element_size: Length | None = None
    """Longest edge when a surface is filled. Default: 2/15 of the longest side (1/15 for 4-node elements), and down
    to a quarter of that where the shape needs it."""
    element: Element | None = None
    """`linear` has 4 nodes an element, `quadratic` 10. Default: quadratic for a surface; a volume mesh stays as it
    is."""
    refine: list[RefineTable] = Field(default_factory=list)
    """Balls with finer elements."""
    mesher: Mesher | None = None
    """`netgen` fills a closed surface itself, `wrap` fills what any surface encloses. Default: chosen by the
    surface."""
    part: Annotated[int | str, _PART] = 1
    """Which part of a surface with several parts: its rank in volume, or `"all"`."""
    max_volume_loss: Share = 0.05
    """Largest share of the volume that the mesh of a wrapped surface may lose."""
    segment: list[SegmentTable] = Field(default_factory=list)
    """Segments of a label map that form the body."""
    precision: str | None = Field(None, pattern="^f(16|32|64)$")
    """Numbers of the store: `f16`, `f32` or `f64`. Default: the smallest that answers touches to 0.03 %."""
    position: Point = (0.0, 0.0, 0.0)
    """Origin of the body's own frame in the scene."""
    orientation: Orientation = (1.0, 0.0, 0.0, 0.0)
    """Rotation of the body's own frame in the scene: a unit quaternion w x y z."""
    supports: SupportsTable | None = None
    """Supports of this body, in place of those of the scene."""
    touch: TouchTable | None = None
    """Touch region of this body, in place of that of the scene."""
    material: MaterialTable | None = None
    """Material of this body, in place of that of the scene."""
    region: list[RegionTable] | None = None
    """Regions of this body, in place of those of the scene."""
    loads: list[LoadTable] | None = None
    """Loads of this body, in place of those of the scene."""
    dynamics: DynamicsTable | None = None
    """Motion of this body, in place of that of the scene."""

    @model_validator(mode="after")
    def _one_source(self) -> BodyTable:
        if sum(source is not None for source in (self.mesh, self.model, self.store)) != 1:
            raise ValueError("give exactly one of mesh, model and store")
        if self.model is not None and self.model not in models.NAMES:
            raise ValueError(f"unknown model '{self.model}'; there are {', '.join(models.NAMES)}")
        if self.segment and not is_segmentation(self.mesh or ""):
            raise ValueError(f"segment is for a mesh that is a label map ({', '.join(SEGMENTATION_ENDINGS)})")
        if self.unit is not None:
            with explained():
                length_scale(self.unit)
        return self

    @property
    def title(self) -> str:
        """What the body is called: its name, the model, or the file without its ending."""
        return self.name or self.model or Path(self.mesh or self.store or "").stem

    @property
    def fills_a_surface(self) -> bool:
        """Whether the mesh is yet to be made."""
        return Path(self.mesh or "").suffix.lower() in SURFACE_ENDINGS or is_segmentation(self.mesh or "")

    @property
    def fill_options(self) -> FillOptions:
        """How its surface is filled."""
        segments = tuple(table.name for table in self.segment)
        return FillOptions(self.mesher, self.part, self.max_volume_loss, segments)  # type: ignore[arg-type]

    def segment_materials(self, mesh: TetMesh, base: MaterialTable) -> dict[str, Material]:
        """Material of each segment by its name in the file, for the mesh that was made of them."""
        # The mesh has the names in the order of the tables, which may give labels instead.
        names = list(mesh.region_names)[: len(self.segment)]
        return {name: table.material(base) for name, table in zip(names, self.segment, strict=True)}

    @property
    def adds_middles(self) -> bool:
        """Whether 4-node tetrahedra become 10-node ones."""
        return self.element == "quadratic" or (self.element is None and self.fills_a_surface)


class ToolTable(ShapeTable):
    """A tool: what it looks like, how it touches, and what it rubs with.

    ``contact = "local"`` is contact with a half-space in series with the finite elements. ``"patch"`` sticks to what it
    first touched. Under ``"node"`` the stiffness goes to zero with the size of the elements. A tool that grabs holds on
    by the disc of ``contact_radius``, whatever its law.
    """

    contact: Literal["local", "patch", "node"] = "local"
    """Contact law. `local` slides with friction; `patch` sticks with a disc of `contact_radius`; `node` takes the
    closest node, as in the paper."""
    friction: Annotated[float, Field(ge=0, le=MOST_FRICTION, allow_inf_nan=False)] = 0.3
    """Coulomb's coefficient under `local`, at most 10; 0 slides freely."""
    pad_youngs_modulus: Pressure | None = None
    """Young's modulus of a soft pad on the tool, under `local`. Default: a rigid tool."""
    contact_radius: Radius | None = None
    """Radius of the disc of `patch`, and of what a grab holds. A tool with this key and no `contact` is a `patch`."""
    device: str | None = None
    """Device that moves the tool: the name of a `[[device]]` table, or a kind of device."""

    @model_validator(mode="before")
    @classmethod
    def _patch_by_radius(cls, given: Any) -> Any:
        """Take a tool with a contact radius for a patch."""
        names_radius = isinstance(given, dict) and "contact_radius" in given and "contact" not in given
        return {**given, "contact": "patch"} if names_radius else given

    @model_validator(mode="after")
    def _spheres_alone_stick(self) -> ToolTable:
        if self.shape != "sphere" and self.contact != "local":
            raise ValueError(f"contact = '{self.contact}' is for spheres: a tool of shape '{self.shape}' takes 'local'")
        return self


def device_ranks(tools: Sequence[ToolTable], tables: Sequence[DeviceTable]) -> list[int | None]:
    """Rank of the table of each tool's device; None for a device without one.

    A tool takes the table that it names, or the first of the kind that it names which no other tool has. A tool that
    names none takes the table of its own rank, unless that has a name or another tool has it. Raises TableError for a
    name that is neither of a table nor of a kind, or a table of two tools.
    """
    names = [table.name for table in tables]
    taken: dict[int, int] = {}
    chosen: list[int | None] = [None] * len(tools)

    def take(tool: int, rank: int) -> None:
        chosen[tool] = rank
        taken[rank] = tool

    for tool, asked in enumerate(tool.device for tool in tools):
        if asked in names and asked is not None:
            rank = names.index(asked)
            if rank in taken:
                raise TableError(
                    f"tools {taken[rank]} and {tool} both have the device '{asked}'", ("tool", tool, "device")
                )
            take(tool, rank)
        elif asked is not None and asked not in KINDS:
            known = [name for name in names if name] + list(KINDS)
            raise TableError(f"there is no device '{asked}'; there are {', '.join(known)}", ("tool", tool, "device"))
    for tool, asked in enumerate(tool.device for tool in tools):
        if chosen[tool] is None and asked is not None:
            fitting = (r for r, table in enumerate(tables) if table.kind == asked and r not in taken)
            rank = next(fitting, None)
            if rank is not None:
                take(tool, rank)
    for tool, asked in enumerate(tool.device for tool in tools):
        if (
            asked is None
            and tool < len(tables)
            and tool not in taken
            and (tables[tool].name is None or len(tools) == 1)
        ):
            take(tool, tool)
    return chosen


def check_tables(first: DeviceTable, additional: Sequence[DeviceTable]) -> None:
    """Raise TableError for what belongs to the loop in any but the first table, and for a name of two tables."""
    for rank, table in enumerate(additional, 1):
        for key in LOOP_KEYS:
            if key in table.model_fields_set:
                raise TableError(
                    f"{key} is of the whole loop: give it in the first table [[device]]", ("device", rank, key)
                )
    names = [table.name for table in (first, *additional)]
    for rank, name in enumerate(names):
        if name is not None and name in names[:rank]:
            raise TableError(f"two tables have the name '{name}'", ("device", rank, "name"))


class ViewTable(Table):
    """Where the camera stands and what it looks at, m (by default the whole body), and the strain that limits the tool.

    Linear elasticity is accurate up to about 10 % strain, where the page warns; finger presses go beyond.
    """

    position: tuple[float, float, float] | None = None
    """Position of the camera, m. Default: the whole body is in view."""
    target: tuple[float, float, float] | None = None
    """Point that the camera looks at, m."""
    strain_limit: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = STRAIN_LIMIT
    """Largest strain to which tools take a body; 0 switches the limit off."""


class SceneTables(Table):
    """All tables of a scene, and the file that they were read from."""

    bodies: list[BodyTable] = Field(alias="body", min_length=1, max_length=MOST_BODIES)
    supports: SupportsTable = SupportsTable()
    touch: TouchTable = TouchTable()
    material: MaterialTable = MaterialTable()
    region: list[RegionTable] = Field(default_factory=list)
    loads: list[LoadTable] = Field(default_factory=list)
    tools: list[ToolTable] = Field(default=[ToolTable()], alias="tool", min_length=1, max_length=MOST_TOOLS)
    device: DeviceTable = DeviceTable()
    # As no file can name it: there they stand in further tables [[device]].
    additional_devices: list[DeviceTable] = Field(default_factory=list, alias="[[device]]", max_length=MOST_TOOLS - 1)
    dynamics: DynamicsTable | None = None
    view: ViewTable = ViewTable()

    _source: tuple[Path, str] | None = PrivateAttr(None)

    @field_validator("bodies", "tools", mode="before")
    @classmethod
    def _single(cls, tables: Any) -> Any:
        """Take a single table as the only entry."""
        return tables if isinstance(tables, list) else [tables]

    @model_validator(mode="before")
    @classmethod
    def _several_devices(cls, given: Any) -> Any:
        """Take the first of several device tables for that of the scene, for the loop and its limits stand there."""
        if not isinstance(given, dict) or not isinstance(given.get("device"), list):
            return given
        if not given["device"]:
            return {key: value for key, value in given.items() if key != "device"}
        first, *others = given["device"]
        return {**given, "device": first, "[[device]]": others}

    @model_validator(mode="after")
    def _devices_of_tools(self) -> SceneTables:
        check_tables(self.device, self.additional_devices)
        device_ranks(self.tools, [self.device, *self.additional_devices])
        return self

    def device_of(self, tool: int) -> DeviceTable:
        """Table of the device that moves a tool."""
        tables = [self.device, *self.additional_devices]
        rank = device_ranks(self.tools, tables)[tool]
        return self.device.of_kind(self.tools[tool].device) if rank is None else tables[rank]

    def __repr__(self) -> str:
        bodies = ", ".join(
            f"model {body.model}" if body.model else str(body.mesh or body.store) for body in self.bodies
        )
        moves = any(body.dynamics or self.dynamics for body in self.bodies)
        radii = ", ".join("by the body" if t.radius is None else f"{1e3 * t.radius:.4g} mm" for t in self.tools)
        tools = f"tool of radius {radii}" if len(self.tools) == 1 else f"tools of radius {radii}"
        return f"{type(self).__name__}({bodies}{', in motion' if moves else ''}, {tools})"

    @property
    def name(self) -> str:
        """What the scene is called: after its bodies."""
        return "-".join(body.title for body in self.bodies)

    @property
    def source(self) -> tuple[Path, str]:
        """File behind the scene and its text; of a scene made by a program its name, and no text."""
        return self._source or (Path(self.name), "")

    @property
    def folder(self) -> Path:
        """Where the paths of the scene start."""
        return Path() if self._source is None else self._source[0].parent


def tables_of_tools(scene: SceneTables, without: int | None = None) -> list[DeviceTable]:
    """One table a tool, in their order, that of the loop in the first; leaves one tool out."""
    loop = {key: getattr(scene.device, key) for key in LOOP_KEYS if key in scene.device.model_fields_set}
    tables = []
    for tool in range(len(scene.tools)):
        if tool == without:
            continue
        own = scene.device_of(tool).model_dump(exclude_unset=True, exclude={"name", *LOOP_KEYS})
        tables.append(DeviceTable(**own, **(loop if not tables else {})))
    return tables


def device_change(scene: SceneTables, tool: int, kind: str) -> dict[str, Any]:
    """Give the changes of a scene in which a tool has a device of another kind, at the place of the one it had."""
    tables = tables_of_tools(scene)
    settings = tables[tool].model_dump(exclude_unset=True, exclude={"id", "address", "library"})
    tables[tool] = DeviceTable(**{**settings, "kind": kind})
    return {"tools": without_devices(scene.tools), "device": tables[0], "additional_devices": tables[1:]}


def without_devices(tools: Sequence[ToolTable]) -> list[ToolTable]:
    """Tools that name no device: each takes the table of its rank."""
    return [tool.model_copy(update={"device": None}) for tool in tools]
