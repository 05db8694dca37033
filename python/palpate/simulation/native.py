"""What the native part of a simulation takes: bodies and tools of a scene, and devices, opened when the loop starts."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate import _native
from palpate.body import surface_strain_terms
from palpate.devices import Device, DeviceLimits
from palpate.errors import BodyError, DeviceError, DeviceWarning, Error, SceneError
from palpate.scene import BuiltBody, DeviceTable
from palpate.scene.mistakes import located
from palpate.scene.tables import SceneTables


def require_devices(devices: Mapping[int, Device]) -> None:
    """Raise DeviceError for what is no device, with the tool, and what it was given."""
    for tool, device in devices.items():
        if not isinstance(device, Device):
            given = f"the class {device.__name__}" if isinstance(device, type) else type(device).__name__
            raise DeviceError(f"the device of tool {tool} must be an object of a palpate.Device, got {given}")


def largest_force(scene: SceneTables) -> float:
    """Largest force in the scene that some device of it may put out, N."""
    return max(_forces(scene))


def largest_stiffness(table: DeviceTable) -> float:
    """Largest stiffness in the scene that a device is asked for, N/m: ``scale * force_scale`` of it is in the hand."""
    return table.max_stiffness / (table.scale * table.force_scale)


def assume_tables(core: _native.SimulationCore, scene: SceneTables) -> None:
    """Keep each tool to the force of its own device, where devices differ."""
    forces = _forces(scene)
    if any(force != max(forces) for force in forces):
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


def _forces(scene: SceneTables) -> list[float]:
    """Largest force in the scene that the device of each tool may put out, N."""
    tables = [scene.device_of(tool) for tool in range(len(scene.tools))]
    return [table.max_force / table.force_scale for table in tables]


def core_of(scene: SceneTables, bodies: Sequence[tuple[Any, ...]]) -> _native.SimulationCore:
    """Make the native part of a simulation, from :func:`body_arguments` of its bodies; Error for what it refuses."""
    device = scene.device
    return _native.SimulationCore(
        bodies,
        [tool_arguments(scene, rank) for rank in range(len(scene.tools))],
        (largest_force(scene), device.max_slew, device.ramp),
        scene.view.strain_limit,
        (device.rate, device.cpus, device.priority),
    )


def needs_moduli(scene: SceneTables) -> bool:
    """Whether a tool of a scene follows the local law, which needs the elastic constants at the surfaces."""
    return any(tool.contact == "local" for tool in scene.tools)


def tool_arguments(scene: SceneTables, rank: int) -> tuple[Any, ...]:
    """Shape and numbers of one tool in the order of the native module.

    Raises SceneError for a surface file that is missing, cannot be read or holds no closed surface, with its line.
    """
    tool, most = scene.tools[rank], largest_stiffness(scene.device_of(rank))
    try:
        shape = tool.shape_arguments(scene.folder)
    except Error as error:
        path, text = scene.source
        raise SceneError(f"{located(path, text, ['tool', rank, 'shape'])}: tool.shape: {error}") from None
    # Settings have the names of their keys in the table.
    settings = {name: getattr(tool, name) for name in _native.TOOL_SETTINGS}
    return shape, tool.contact, most, tool.pad_youngs_modulus, settings


def body_arguments(body: BuiltBody, local: bool) -> tuple[Any, ...]:
    """Arrays of one body in the order of the native module.

    Elastic constants at the surface are given wherever they are known, because a tool under the local law may come
    later. Raises BodyError for a store that does not know them, under a ``local`` law.
    """
    motion = body.motion
    moving = None
    if motion is not None:
        shapes = motion.basis.shapes[body.green.surface_nodes].reshape(-1, len(motion.basis))
        moving = (motion.basis.eigenvalues, np.ascontiguousarray(shapes), motion.scheme, motion.exact, motion.coupling)
    return body.green._core, body.position, body.orientation, moving, _moduli(body, local), list(body.series)


def _moduli(body: BuiltBody, needed: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, bool] | None:
    known = body.green._core.surface_moduli()
    if known is None and needed:
        raise BodyError(
            "this store of several materials does not contain those at the surface: compute it again, or give the tool "
            "contact = 'patch'"
        )
    if known is None:
        return None
    young, poisson, is_even = known
    # A store has the constants at small strain only: the law beyond is that of the scene's material.
    terms = None if body.body is None else surface_strain_terms(body.body)
    return young, poisson, terms, is_even
