"""Scripted press for headless runs: down on the highest free point nearest the middle, and up again."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.scene import BuiltScene
from palpate.scene.build import press_place
from palpate.scene.series import with_whole_series
from palpate.simulation import Frame, Simulation

# Pointer rate of a person's mouse, Hz: the simulated device smooths it as it would theirs.
POINTER_RATE = 120.0
# Frames of a run of which the strain is computed, afterwards: it takes milliseconds of each.
STRAIN_SAMPLES = 100
# A tool that is limited at less than this part of the limit of strain has just begun to touch.
AT_LIMIT = 0.9


@dataclass(frozen=True)
class PressRecord:
    """What a scripted press leaves."""

    log: np.ndarray  # rows of the 1 kHz loop
    # At each row: approach of tool and surface, m, and largest strain; between frames, of which there are 120 and some
    # tens a second, they are interpolated.
    depth: np.ndarray
    strain: np.ndarray
    # The frame with the largest force on the body, and the last one.
    hardest: Frame
    last: Frame
    limited: bool  # whether the limit of strain held the tool
    force: float  # largest on the body in any frame, N; the device's own is within its limits
    interrupted: bool  # whether Ctrl-C ended it early
    # Why the tool was in no contact in some frame though it reached the body; None if that was in none.
    refused: str | None = None


def scripted_press(built: BuiltScene, seconds: float, recording: Path | None = None) -> PressRecord:
    """Press for so many seconds, within the scene's limit of strain, or until Ctrl-C; recorded in a new file.

    A tool that a device moves goes where the hand on it does.
    """
    # The same press has the same forces each time.
    built = with_whole_series(built, True)
    rest, depth = press_place(built)
    logs, depths, sampled = [], [], []
    limited: list[Frame] = []
    interrupted, refused = False, None
    simulation = Simulation(built)
    if recording is not None:
        simulation.record(recording)
    with simulation:
        by_script = 0 not in simulation.devices
        hardest = simulation._read_frame()
        start = time.monotonic()
        try:
            while (elapsed := time.monotonic() - start) < seconds:
                phase = elapsed / seconds
                push = depth * np.clip(4.0 * min(phase - 0.1, 0.85 - phase), -0.1, 1.0)
                if by_script:
                    simulation.move(rest - [0, 0, push])
                time.sleep(1.0 / POINTER_RATE)
                logs.append(simulation.drain_log())
                # The press is along a line: the largest force has the largest strain.
                frame = simulation._read_frame()
                depths.append((frame.time, depth_of_first_tool(frame)))
                if STRAIN_SAMPLES * elapsed >= len(sampled) * seconds:
                    sampled.append(frame)
                hardest = max(hardest, frame, key=_force_on_body)
                refused = refused or frame.statistics["refused"][0]
                if frame.limited[0]:
                    limited = [max(*limited, frame, key=_force_on_body)] if limited else [frame]
        except KeyboardInterrupt:
            interrupted = True
        last = simulation._read_frame()
        logs.append(simulation.drain_log())
    log = np.concatenate(logs)
    sampled = sorted([*sampled, hardest, last], key=lambda frame: frame.time)
    strains = [(frame.time, frame.largest_strain) for frame in sampled]
    columns = (_at_ticks(log["time"], depths), _at_ticks(log["time"], strains))
    most = AT_LIMIT * built.scene.view.strain_limit
    held = any(frame.largest_strain >= most for frame in limited)
    return PressRecord(log, *columns, hardest, last, held, _force_on_body(hardest), interrupted, refused)


def _force_on_body(frame: Frame) -> float:
    """Force of the contacts of the first tool, N, before the safety stage limits what its device puts out."""
    forces = [contact.force for contact in frame.contacts if contact.tool == 0]
    return float(np.linalg.norm(np.sum(forces, axis=0))) if forces else 0.0


def depth_of_first_tool(frame: Frame) -> float:
    """Approach of the first tool and the surface, m; of a tool that sticks to its patch how far that was pushed in.

    Of a tool that touches at several places, where it is deepest.
    """
    pressed = [contact for contact in frame.contacts if contact.tool == 0]
    depths = [contact.depth or -float(contact.displacement @ contact.normal) for contact in pressed]
    return max(depths, default=0.0)


def _at_ticks(time_of_ticks: np.ndarray, samples: Sequence[tuple[float, float]]) -> np.ndarray:
    """Values at the ticks from some (time, value)."""
    if not samples:
        return np.zeros_like(time_of_ticks)
    times, values = np.transpose(samples)
    return np.interp(time_of_ticks, times, values)
