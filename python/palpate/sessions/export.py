"""Recordings for other programs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from palpate.errors import Error
from palpate.input_file import require_writable
from palpate.progress import progress_reporter
from palpate.scene import BuiltScene, Scene
from palpate.sessions import tables
from palpate.sessions.frames import RecordedFrames, Span
from palpate.simulation import Recording

# What each ending is called in a message.
FORMATS = {
    ".csv": "a table, one row a tick",
    ".parquet": "the same, smaller and faster to read",
    ".pvd": "time series for ParaView",
    ".glb": "animation for Blender and viewers of 3D",
    ".mp4": "film for slides",
}
TABLES = (".csv", ".parquet")
RATE = 30.0


def export(
    recording: Recording | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    start: float = 0.0,
    end: float | None = None,
    scene: Scene | BuiltScene | None = None,
    progress: bool | Callable[[int, int], None] = False,
) -> list[Path]:
    """Write a recording in the format of a file's ending; nothing appears that is not complete.

    ``.csv`` and ``.parquet`` have one row a tick, and contacts in a second file, ``<name>-contacts``. ``.pvd``
    (ParaView), ``.glb`` and ``.mp4`` show frames, for which the recording is computed again.

    Parameters
    ----------
    recording
        The recording, or its file.
    path
        Where to write.
    rate
        Frames a second, 30 unless given; tables have every tick.
    start, end
        s since the recording began.
    scene
        In place of that of the recording, with the same bodies; of frames.
    progress
        Shown, or called with done and expected rows or frames.

    Returns
    -------
    list
        Files that were written.

    Raises
    ------
    Error
        An unknown ending, a span without ticks, a recording that cannot be read or computed again, or a package that
        is not installed (``pip install 'palpate[export]'``).

    """
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in FORMATS:
        raise Error(f"{target}: a recording is written as {', '.join(FORMATS)}, got '{target.suffix}'")
    require_writable(target, Error)
    recorded = recording if isinstance(recording, Recording) else Recording.load(recording)
    with progress_reporter(f"writing {target.name}", progress) as report:
        if kind in TABLES:
            if rate is not None:
                raise Error("a rate is for .pvd, .glb and .mp4; a table has a row for every tick: leave the rate out")
            return _write_tables(recorded, target, Span(start, end).within(recorded.time), report)
        span = Span(start, end, RATE if rate is None else rate)
        frames = RecordedFrames(recorded, span, scene)
        return _write_frames(frames, target, span.rate, report)


def _write_frames(frames: RecordedFrames, target: Path, rate: float, report: tables.Report) -> list[Path]:
    """Write frames in the format of the target's ending; its writer loads libraries that no other command needs."""
    kind = target.suffix.lower()
    if kind == ".pvd":
        from palpate.sessions import paraview

        paraview.write_pvd(frames, target, report)
        return [target, paraview.frames_folder(target)]
    if kind == ".glb":
        from palpate.sessions.gltf import write_glb

        write_glb(frames, target, report)
    else:
        from palpate.sessions.film import write_mp4

        write_mp4(frames, target, rate, report)
    return [target]


def _write_tables(recording: Recording, target: Path, rows: np.ndarray, report: tables.Report) -> list[Path]:
    contacts = target.with_name(f"{target.stem}-contacts{target.suffix}")
    both = ((tables.tick_columns(recording, rows), target), (tables.contact_columns(recording, rows), contacts))
    for columns, file in both:
        if target.suffix.lower() == ".csv":
            tables.write_csv(columns, file, report)
        else:
            tables.write_parquet(columns, file, recording.about)
    return [target, contacts]
