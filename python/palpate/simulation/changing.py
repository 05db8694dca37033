"""Adding and removing bodies, tools and devices of a simulation, also while its loop runs."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Concatenate, ParamSpec, TypeVar

from pydantic import ValidationError

from palpate import _native, units
from palpate.body import Body
from palpate.devices import Device
from palpate.errors import SceneError, SimulationError
from palpate.green import GreensFunction, precompute
from palpate.scene import BuiltBody, BuiltScene, Scene, ToolTable
from palpate.scene.devices import KINDS
from palpate.scene.mistakes import reason_of
from palpate.scene.series import with_series_of_tools, with_stored_series
from palpate.scene.tables import BodyTable, SceneTables, device_change, tables_of_tools, without_devices
from palpate.simulation.adjustable import SeriesGrowth
from palpate.simulation.native import (
    body_arguments,
    connect_tool,
    needs_moduli,
    require_devices,
    tool_arguments,
    warn_if_limited,
)
from palpate.vectors import three_numbers

Given, Answer = ParamSpec("Given"), TypeVar("Answer")


def one_at_a_time(
    change: Callable[Concatenate[SceneEditing, Given], Answer],
) -> Callable[Concatenate[SceneEditing, Given], Answer]:
    """Let threads that change a simulation wait for each other: each begins with what the one before has left."""

    @functools.wraps(change)
    def exclusive(simulation: SceneEditing, /, *args: Given.args, **keywords: Given.kwargs) -> Answer:
        with simulation._editing:
            return change(simulation, *args, **keywords)

    return exclusive


class SceneEditing(SeriesGrowth):
    """The nodes of a scene, while they are simulated.

    Ranks of bodies and tools behind one that is removed go down by one. Contacts between what stays go on, and forces
    of what comes ramp in; a device that goes is left at zero force. A loop that is being recorded cannot be changed.
    """

    # Of the scene that the loop has, as the core counts them; None while another one comes in.
    _number: int | None
    _given: dict[int, Device]
    _devices: dict[int, str]

    @one_at_a_time
    def add_body(
        self,
        body: Body | GreensFunction | Scene | Mapping[str, Any],
        position: Sequence[float] | None = None,
        orientation: Sequence[float] | None = None,
    ) -> int:
        """Add a body at a position, m, with an orientation, a unit quaternion w x y z; returns its rank.

        It is computed first, if need be. The first body of a scene, or a mapping with the keys of a ``[body]`` table.
        Their place counts unless ``position`` or ``orientation`` is given here. Of a Green's function the file must
        be there.

        Raises
        ------
        Error
            A body that cannot be built, more bodies than a scene takes, or a loop that is being recorded.

        """
        built, table = _built(body)
        place = _placed(table.position if position is None else position, table.orientation, orientation)
        built, table = replace(built, position=place[0], orientation=place[1]), _moved(table, place)
        scene = self.scene.model_copy(update={"bodies": [*self.scene.bodies, table]})
        if built.series:
            # Of the tools here, not of those of its own scene.
            built = with_stored_series(BuiltScene(scene, (*self.bodies, built))).bodies[-1]
        measure = self._strain_measure_of(built) if self._armed else None
        arguments = body_arguments(built, needs_moduli(scene))
        self._take(scene, (*self.bodies, built), lambda: _native.add_body(self._core, arguments, measure))
        self._continue_series()
        return len(self.bodies) - 1

    @one_at_a_time
    def remove_body(self, body: int) -> None:
        """Remove a body, and the contacts on it.

        Raises
        ------
        Error
            No such body, the last one, or a loop that is being recorded.

        """
        if len(self.bodies) == 1 and self._body(body) == 0:
            raise SceneError("a simulation needs a body: add another one before the last is removed")
        bodies, tables = list(self.bodies), list(self.scene.bodies)
        del bodies[self._body(body)], tables[body]
        scene = self.scene.model_copy(update={"bodies": tables})
        self._take(scene, tuple(bodies), lambda: _native.remove_body(self._core, body))

    @one_at_a_time
    def place_body(self, body: int, position: Sequence[float], orientation: Sequence[float] | None = None) -> None:
        """Put a body at a position, m, with an orientation, a unit quaternion w x y z; None keeps the one it has.

        Contacts go on as if their tools had moved.

        Raises
        ------
        Error
            No such body, numbers that are not finite, or a loop that is being recorded.

        """
        moved = self.bodies[self._body(body)]
        place = _placed(position, moved.orientation, orientation)
        bodies, tables = list(self.bodies), list(self.scene.bodies)
        bodies[body] = replace(moved, position=place[0], orientation=place[1])
        tables[body] = _moved(tables[body], place)
        scene = self.scene.model_copy(update={"bodies": tables})
        self._take(scene, tuple(bodies), lambda: _native.place_body(self._core, body, *place))

    @one_at_a_time
    def take_store(self, body: int, green: GreensFunction, is_growing: bool = False) -> None:
        """Go on with another store of a body, in which more of the same surface may be touched.

        Contacts go on; those on nodes that have left the touch region are released. ``is_growing`` if yet another store
        is being computed.

        Raises
        ------
        Error
            No such body, a store of another surface, or a loop that is being recorded.

        """
        bodies = list(self.bodies)
        bodies[body] = replace(bodies[self._body(body)], green=green, is_growing=is_growing)
        arguments = body_arguments(bodies[body], needs_moduli(self.scene))
        self._take(self.scene, tuple(bodies), lambda: _native.replace_body(self._core, body, arguments))
        self._continue_series()

    @one_at_a_time
    def add_tool(self, device: str | Device = "simulated", **table: Any) -> int:
        """Add a tool, given as in a ``[tool]`` table, moved by a device of a kind or of the program; returns its rank.

        Raises
        ------
        Error
            A mistake in the table, more tools than a scene takes, a device that cannot be opened, or a loop that is
            being recorded.

        """
        try:
            tool = ToolTable(**{"radius": self.scene.tools[0].radius, **table})
        except ValidationError as error:
            place = ".".join(map(str, error.errors()[0]["loc"]))
            raise SceneError(f"{'.'.join(filter(None, ('tool', place)))}: {reason_of(error)}") from None
        given = None if isinstance(device, str) else device
        rank = len(self.scene.tools)
        require_devices({} if given is None else {rank: given})
        kind = device if isinstance(device, str) else "simulated"
        if kind not in KINDS:
            raise SceneError(f"there is no kind of device '{kind}'; there are {', '.join(KINDS)}")
        first, *additional = [*tables_of_tools(self.scene), self.scene.device.of_kind(kind)]
        tools = without_devices(self.scene.tools)
        scene = self.scene.model_copy(
            update={"tools": [*tools, tool], "device": first, "additional_devices": additional}
        )
        built = with_series_of_tools(BuiltScene(scene, self.bodies))
        arguments = tool_arguments(built.scene, rank)
        self._take(built.scene, built.bodies, lambda: _native.add_tool(self._core, arguments))
        self._continue_series()
        if given is not None:
            self._given[rank] = given
        if self._running and (given is not None or kind != "simulated"):
            try:
                self._devices[rank] = connect_tool(self._core, self.scene, rank, given)
                warn_if_limited(self._core, rank, self._devices[rank])
            except BaseException:
                self.remove_tool(rank)
                raise
        return rank

    @one_at_a_time
    def remove_tool(self, tool: int) -> None:
        """Remove a tool, and its contacts; its device is left at zero force.

        Raises
        ------
        Error
            No such tool, the last one, or a loop that is being recorded.

        """
        if len(self.scene.tools) == 1 and self._tool(tool) == 0:
            raise SceneError("a simulation needs a tool: add another one before the last is removed")
        devices = tables_of_tools(self.scene, without=self._tool(tool))
        tools = without_devices(self.scene.tools)
        update = {"tools": tools[:tool] + tools[tool + 1 :], "device": devices[0], "additional_devices": devices[1:]}
        scene = self.scene.model_copy(update=update)
        self._take(scene, self.bodies, lambda: _native.remove_tool(self._core, tool))
        gone, connected = self._given.pop(tool, None), tool in self._devices
        self._given = {rank - (rank > tool): given for rank, given in self._given.items()}
        self._devices = {rank - (rank > tool): name for rank, name in self._devices.items() if rank != tool}
        if gone is not None and connected:
            gone.close_for_loop()

    @one_at_a_time
    def connect(self, tool: int, device: Device | str) -> str:
        """Let a tool of the running loop be moved by another device: of the program, or of a kind; returns its name.

        Forces ramp in. The device that moved the tool is left at zero force.

        Raises
        ------
        Error
            A device that cannot be opened or calls the loop itself, a loop that does not run or is being recorded.

        """
        self._tool(tool)
        if not self._running:
            raise SimulationError("the simulation does not run: give it its devices, or their kinds in the scene")
        given = None if isinstance(device, str) else device
        require_devices({} if given is None else {tool: given})
        kind = device if isinstance(device, str) else "simulated"
        if given is None and kind not in KINDS[1:]:
            raise SceneError(f"there is no kind of device '{kind}' to connect; there are {', '.join(KINDS[1:])}")
        scene = self.scene.model_copy(update=device_change(self.scene, tool, kind))
        self._devices[tool] = connect_tool(self._core, scene, tool, given)
        self.scene, before = scene, self._given.pop(tool, None)
        if given is not None:
            self._given[tool] = given
        if before is not None:
            before.close_for_loop()
        warn_if_limited(self._core, tool, self._devices[tool])
        return self._devices[tool]

    def _take(self, scene: SceneTables, bodies: tuple[BuiltBody, ...], change: Callable[[], int]) -> None:
        """Go on with another scene once the core has changed to it."""
        number = change()
        # Until all belongs to the new scene, none of it is taken for a frame.
        self._number = None
        self.scene, self.bodies = scene, bodies
        self._number = number
        self._offer_series()


def _built(body: Body | GreensFunction | Scene | Mapping[str, Any]) -> tuple[BuiltBody, BodyTable]:
    """Build a body, and give the table that describes it."""
    if isinstance(body, (Body, GreensFunction)):
        green = precompute(body) if isinstance(body, Body) else body
        if green.path is None:
            raise SceneError("a body that is added needs the file of its Green's function: save it first")
        table = BodyTable(store=str(green.path))
        return BuiltBody(body if isinstance(body, Body) else None, green, None, table.title), table
    scene = body if isinstance(body, Scene) else Scene(body=dict(body))
    built = scene.build()
    return built.bodies[0], built.scene.bodies[0]


def _placed(
    position: Sequence[float], before: Sequence[float], orientation: Sequence[float] | None
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position and orientation, checked by the table of a body."""
    place = tuple(three_numbers(position, "a body's position", SceneError, units.length))
    turned = tuple(map(float, before if orientation is None else orientation))
    try:
        BodyTable(model="beam", position=place, orientation=turned)
    except ValidationError as error:
        raise SceneError(f"a body's orientation: {reason_of(error)}") from None
    return place, turned


def _moved(table: BodyTable, place: tuple[tuple[float, ...], tuple[float, ...]]) -> BodyTable:
    return table.model_copy(update={"position": place[0], "orientation": place[1]})
