"""Rerun of a recorded hand's motion in another scene."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from palpate import _native
from palpate.errors import SceneError
from palpate.progress import progress_reporter
from palpate.scene import BuiltScene, Scene
from palpate.simulation import Recording, Simulation, shown_of, ticks_before_gap


def rerun(
    recording: Recording | str | os.PathLike[str],
    scene: Scene | BuiltScene,
    progress: bool | Callable[[int, int], None] = False,
) -> Recording:
    """Give the inputs of a recording to another scene, without a clock, up to the first tick that was dropped.

    Poses, velocities, buttons, strikes, resets and slow motion are those of the recording. Bodies, tools, limits of
    devices and all other settings are those of the scene. The same scene gives the same bits, apart from the limit of
    strain where the recorded loop ran on a clock: its responses come 16 ticks after they were asked for, as in
    :meth:`palpate.Simulation.play`.

    Parameters
    ----------
    recording
        The recording, or its file.
    scene
        With as many tools.
    progress
        Shown, or called with done and expected ticks.

    Raises
    ------
    Error
        A recording that cannot be read, or a scene that cannot be built or has another number of tools or rate.

    """
    recorded = recording if isinstance(recording, Recording) else Recording.load(Path(recording))
    simulation = Simulation(scene)
    about = dict(recorded.about)
    tools, rate = int(about["tools"]), float(about["rate"])
    if len(simulation.scene.tools) != tools:
        raise SceneError(f"the recording has {tools} tools, the scene {len(simulation.scene.tools)}")
    if simulation.scene.device.rate != rate:
        raise SceneError(f"the recording has {rate:g} ticks a second, the scene {simulation.scene.device.rate:g}")
    simulation._arm_strain_limit()
    simulation.complete_series(progress)
    expected = ticks_before_gap(recorded)
    now = simulation._about(shown_of(about), clock=False)
    with progress_reporter("running again", progress) as report:
        on_tick = None if report is None else lambda done: report(done, expected)
        columns = _native.rerun(simulation._core, recorded.source, now, on_tick)
    return Recording._of(columns)
