"""Devices of a scene: their workspaces and limits."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field

from palpate.scene.table import Force, Orientation, Point, Stiffness, Table, Time, is_whole, one_of

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

    The axes of its own frame are x to the right, y away, z up for the person in front of it. ``max_force`` and
    ``max_stiffness`` are kept at the device, by the safety stage and by the contact; a device that renders less has
    lower ones of its own. A ``priority`` that is given and not granted raises a warning; the default appears in the
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
    orientation: Orientation = (1.0, 0.0, 0.0, 0.0)
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

    def of_kind(self, kind: str | None) -> DeviceTable:
        """Table of another device of some kind, with the limits of this one."""
        given = {name: getattr(self, name) for name in ("max_force", "max_stiffness")}
        return DeviceTable(kind=kind or "simulated", **given)

    @property
    def title(self) -> str:
        """What the device is called."""
        return self.name or self.kind
