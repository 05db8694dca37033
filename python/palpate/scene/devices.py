"""Devices of a scene: which one moves each tool, its workspace and its limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Protocol, get_args

import numpy as np
from pydantic import Field, field_validator

from palpate.scene.table import Force, Number, Point, Stiffness, Table, TableError, Time, is_whole, one_of

Kind = Literal["simulated", "haply", "touch", "forcedimension"]
KINDS: tuple[str, ...] = get_args(Kind)
# Of the loop: they stand in the first of several tables.
LOOP_KEYS = ("rate", "cpus", "priority", "max_slew", "ramp")

Scale = Annotated[float, Field(gt=0, allow_inf_nan=False)]

_CPUS = one_of(
    "a list of processors, such as [1]",
    lambda v: isinstance(v, (list, tuple)) and all(map(is_whole, v)) and len(set(v)) == len(v),
)


class DeviceTable(Table):
    """A device, where its workspace lies in the scene, and its limits; of the first table also how the loop runs.

    ``kind`` is what it is: ``simulated`` follows a pointer or a program. ``id`` chooses among several of a kind,
    ``address`` is that of its service and ``library`` the vendor's library, where the driver's own choice will not do.

    ``position`` (m) is where the device's origin lies in the scene, ``orientation`` (unit quaternion w x y z) how its
    axes stand there. They are x to the right, y away, z up for the person in front of it. ``scale`` is metres of the
    scene per metre of the device, ``force_scale`` the force on the hand per force in the scene. While button ``clutch``
    is held the tool is out of the scene, and the hand can reach for more.

    ``max_force`` and ``max_stiffness`` are kept at the device, by the safety stage and by the contact; a device that
    renders less has lower ones of its own. ``cpus`` are the processors that the loop's thread keeps to, by their
    numbers; none for any. ``priority`` is that under ``SCHED_FIFO``, 1 to 99, where the system grants it, or 0 for
    ordinary scheduling. A priority that is given and not granted raises a warning; the default appears in the
    statistics only.
    """

    name: Annotated[str, Field(min_length=1)] | None = None
    """Name by which a tool chooses this device."""
    kind: Kind = "simulated"
    """Kind of device. `simulated` follows the pointer of the page, or a program."""
    id: str | None = None
    """Which of several devices of a kind. Default: the first that is free."""
    address: str | None = None
    """Address of the device's service."""
    library: str | None = None
    """Path of the vendor's library. Default: the driver searches for it."""
    position: Point = (0.0, 0.0, 0.0)
    """Origin of the device's frame in the scene."""
    orientation: tuple[Number, Number, Number, Number] = (1.0, 0.0, 0.0, 0.0)
    """Rotation of the device's frame in the scene: a unit quaternion w x y z."""
    scale: Scale = 1.0
    """Metres of the scene per metre of the device."""
    force_scale: Scale = 1.0
    """Newtons on the hand per newton in the scene."""
    clutch: Annotated[int, Field(ge=0, le=31)] | None = None
    """Number of the button that takes the tool out of the scene while it is held, so that the hand can reach for
    more."""
    max_force: Force = 8.0
    """Largest force on the hand."""
    max_slew: Annotated[float, Field(gt=0)] = 500.0
    """Fastest rise of the force, N/s. It does not limit a release."""
    ramp: Time = 0.25
    """Time over which forces rise after the start and after a reset."""
    max_stiffness: Stiffness = 5000.0
    """Largest stiffness of a contact at the hand."""
    rate: Annotated[float, Field(ge=100, le=10_000)] = 1000.0
    """Ticks a second, 100 to 10 000. Belongs in the first table."""
    cpus: Annotated[tuple[int, ...], _CPUS] = ()
    """Processors on which the loop's thread runs. Default: any. Belongs in the first table."""
    priority: Annotated[int, Field(ge=0, le=99)] = 80
    """Priority of the loop's thread under `SCHED_FIFO`, 1 to 99; 0 for ordinary scheduling. Belongs in the first
    table."""

    @field_validator("orientation")
    @classmethod
    def _of_length_one(cls, given: tuple[float, ...]) -> tuple[float, ...]:
        if abs(np.linalg.norm(given) - 1.0) > 1e-6:
            raise ValueError(f"must be a unit quaternion w x y z, got {list(given)}")
        return given

    def of_kind(self, kind: str | None) -> DeviceTable:
        """Table of another device of some kind, with the limits of this one."""
        given = {name: getattr(self, name) for name in ("max_force", "max_stiffness")}
        return DeviceTable(kind=kind or "simulated", **given)

    @property
    def title(self) -> str:
        """What the device is called."""
        return self.name or self.kind


class _Tool(Protocol):
    device: str | None

    def model_copy(self, *, update: dict[str, Any]) -> Any: ...


def device_ranks(tools: Sequence[_Tool], tables: Sequence[DeviceTable]) -> list[int | None]:
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


class _Scene(Protocol):
    tools: Sequence[_Tool]
    device: DeviceTable

    def device_of(self, tool: int) -> DeviceTable: ...


def tables_of_tools(scene: _Scene, without: int | None = None) -> list[DeviceTable]:
    """One table a tool, in their order, that of the loop in the first; leaves one tool out."""
    loop = {key: getattr(scene.device, key) for key in LOOP_KEYS if key in scene.device.model_fields_set}
    tables = []
    for tool in range(len(scene.tools)):
        if tool == without:
            continue
        own = scene.device_of(tool).model_dump(exclude_unset=True, exclude={"name", *LOOP_KEYS})
        tables.append(DeviceTable(**own, **(loop if not tables else {})))
    return tables


def device_change(scene: _Scene, tool: int, kind: str) -> dict[str, Any]:
    """Give the changes of a scene in which a tool has a device of another kind, at the place of the one it had."""
    tables = tables_of_tools(scene)
    settings = tables[tool].model_dump(exclude_unset=True, exclude={"id", "address", "library"})
    tables[tool] = DeviceTable(**{**settings, "kind": kind})
    return {"tools": without_devices(scene.tools), "device": tables[0], "additional_devices": tables[1:]}


def without_devices(tools: Sequence[_Tool]) -> list[Any]:
    """Tools that name no device: each takes the table of its rank."""
    return [tool.model_copy(update={"device": None}) for tool in tools]
