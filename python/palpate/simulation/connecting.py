"""Devices of a simulation: opening them when the loop starts, with workspaces and limits."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import Any

from palpate import _native
from palpate.devices import Device, DeviceLimits
from palpate.errors import DeviceError, DeviceWarning
from palpate.scene import DeviceTable
from palpate.scene.tables import SceneTables


def require_devices(devices: Mapping[int, Device]) -> None:
    """Raise DeviceError for what is no device, with the tool, and what it was given."""
    for tool, device in devices.items():
        if not isinstance(device, Device):
            given = f"the class {device.__name__}" if isinstance(device, type) else type(device).__name__
            raise DeviceError(f"the device of tool {tool} must be an object of a palpate.Device, got {given}")


def largest_force(scene: SceneTables) -> float:
    """Largest force in the scene that some device of it may put out, N."""
    return max(table.max_force / table.force_scale for table in _tables(scene))


def largest_stiffness(table: DeviceTable) -> float:
    """Largest stiffness in the scene that a device is asked for, N/m: ``scale * force_scale`` of it is in the hand."""
    return table.max_stiffness / (table.scale * table.force_scale)


def assume_tables(core: _native.SimulationCore, scene: SceneTables) -> None:
    """Keep each tool to the force of its own device, where devices differ."""
    forces, most = [table.max_force / table.force_scale for table in _tables(scene)], largest_force(scene)
    if any(force != most for force in forces):
        limits = [DeviceLimits(max_force=force, max_speed=None) for force in forces]
        _native.assume_devices(core, [limit.arguments for limit in limits])


def assume_recorded(core: _native.SimulationCore, about: Mapping[str, str]) -> None:
    """Take the devices to be those of a recording: what they hold is part of what was computed."""
    if "devices" in about:
        _native.assume_devices(core, [tuple(limits) for limits in json.loads(about["devices"])])


def connect(core: _native.SimulationCore, scene: SceneTables, given: Mapping[int, Device]) -> dict[int, str]:
    """Open the device of every tool that is not simulated; what they are called, by tool.

    A device that holds less than the scene asks for is warned of: contacts are then rendered as soft as it needs.
    Raises DeviceError for a device that cannot be opened, and what to do.
    """
    names = {}
    try:
        for tool in range(len(scene.tools)):
            if tool in given or scene.device_of(tool).kind != "simulated":
                names[tool] = connect_tool(core, scene, tool, given.get(tool))
        for tool, name in names.items():
            warn_if_limited(core, tool, name)
    except BaseException:
        disconnect(core, given, names)
        raise
    return names


def disconnect(core: _native.SimulationCore, given: Mapping[int, Device], names: Mapping[int, str]) -> None:
    """Let go of devices that were opened, by tool."""
    _native.disconnect(core)
    for tool in names:
        if tool in given:
            given[tool].close_for_loop()


def connect_tool(core: _native.SimulationCore, scene: SceneTables, tool: int, given: Device | None) -> str:
    """Open the device of one tool, and give it to the loop; what it is called."""
    table = scene.device_of(tool)
    if given is None:
        opened = _native.OpenedDevice(table.kind, table.id, table.address, table.library)
    else:
        opened = given.open_for_loop(scene.device.rate)
    limits = DeviceLimits(max_force=table.max_force, max_stiffness=table.max_stiffness, max_speed=None)
    try:
        _native.connect(core, tool, opened, workspace_of(table), limits.arguments)
    except BaseException:
        if given is not None:
            given.close_for_loop()
        raise
    return opened.name


def warn_if_limited(core: _native.SimulationCore, tool: int, name: str) -> None:
    """Warn of a device that holds less than the scene asks for."""
    asked, held = _native.tool_stiffness(core)[tool]
    if held < asked:
        warnings.warn(
            f"tool {tool}: {name} renders contacts up to {held:.4g} N/m, and this scene has up to {asked:.4g}: stiffer "
            f"contacts feel softer than they are",
            DeviceWarning,
            stacklevel=4,
        )


def workspace_of(table: DeviceTable) -> tuple[Any, ...]:
    """Where a device lies in the scene, in the order of the native module."""
    return table.position, table.orientation, table.scale, table.force_scale, table.clutch


def _tables(scene: SceneTables) -> list[DeviceTable]:
    return [scene.device_of(tool) for tool in range(len(scene.tools))]
