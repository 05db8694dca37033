"""How the loop's thread is scheduled: processors and priority, from the scene or in its place."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace

from pydantic import ValidationError

from palpate import _native
from palpate.errors import SceneError, SchedulingWarning
from palpate.scene import BuiltScene, Scene
from palpate.scene.mistakes import reason_of
from palpate.scene.tables import DeviceTable
from palpate.units import brief_repr


def scheduled(scene: Scene | BuiltScene, cpus: Sequence[int] | None, priority: int | None) -> BuiltScene:
    """Build a scene, with processors and priority in place of its own where they are given.

    What is given and this machine does not have is refused before anything is computed; what a scene of another machine
    says only when its loop starts. Raises SceneError for what is no scene, a priority out of range, or processors that
    this process may not run on.
    """
    if not isinstance(scene, (Scene, BuiltScene)):
        raise SceneError(f"a simulation takes a palpate.Scene, got {brief_repr(scene)}: Scene.read reads a file")
    tables = scene.scene if isinstance(scene, BuiltScene) else scene
    device = with_scheduling(tables.device, cpus, priority)
    if device is tables.device:
        return scene if isinstance(scene, BuiltScene) else scene.build()
    if isinstance(scene, BuiltScene):
        return replace(scene, scene=tables.model_copy(update={"device": device}))
    return scene.model_copy(update={"device": device}).build()


def with_scheduling(device: DeviceTable, cpus: Sequence[int] | None, priority: int | None) -> DeviceTable:
    """Table of a device with other processors and another priority; None keeps its own.

    Raises SceneError for a priority out of range, or processors that this process may not run on.
    """
    given = {"cpus": cpus if cpus is None else tuple(cpus), "priority": priority}
    changes = {name: value for name, value in given.items() if value is not None}
    try:
        table = DeviceTable(**{**device.model_dump(exclude_unset=True), **changes}) if changes else device
    except ValidationError as error:
        first = error.errors()[0]
        raise SceneError(f"device.{first['loc'][0]}: {reason_of(error)}, got {first['input']}") from None
    if cpus is not None:
        require_cpus(table.cpus)
    return table


def start_loop(core: _native.SimulationCore, device: DeviceTable) -> None:
    """Start the loop with the scheduling of a scene, and warn of a priority asked for by name that is not granted.

    Raises SceneError for processors that this process may not run on.
    """
    require_cpus(device.cpus)
    priority, locked_memory = core.start()
    if priority or device.priority == 0 or "priority" not in device.model_fields_set:
        return
    memory = "" if locked_memory else ", nor locked memory"
    warnings.warn(
        f"device.priority = {device.priority}: the system granted no real-time priority{memory}; the loop runs "
        "at normal priority and may wake late: 'palpate doctor' prints what to change",
        SchedulingWarning,
        stacklevel=3,
    )


def require_cpus(cpus: Sequence[int]) -> None:
    """Refuse processors that this process may not run on: the system would leave them out without a word.

    SceneError says which they are, and which there are.
    """
    if not cpus:
        return
    if not hasattr(os, "sched_getaffinity"):
        raise SceneError("device.cpus: this system cannot keep a thread to some processors: leave the key out")
    allowed = os.sched_getaffinity(0)
    missing = [cpu for cpu in cpus if cpu not in allowed]
    if missing:
        raise SceneError(
            f"device.cpus: this process may not run on CPU {cpu_ranges(missing)}, only on {cpu_ranges(allowed)}: "
            "choose among them, or widen its set (taskset, cgroup cpuset)"
        )


def cpu_ranges(cpus: Iterable[int]) -> str:
    """Processors as the kernel writes them: ``0-3,6``."""
    texts: list[list[int]] = []
    for cpu in sorted(cpus):
        if texts and texts[-1][-1] == cpu - 1:
            texts[-1][1:] = [cpu]
        else:
            texts.append([cpu])
    return ",".join("-".join(map(str, ends)) for ends in texts)
