"""Ticks in WebAssembly beside native ones, in the same run, for every kind of tick under the local law.

Both play the same path on the same plate by the same loop, in turn; WebAssembly in Node. The time of a tick is the
shortest over its plays, and "median" the median of these. Native ticks are timed by the clock of their thread, those in
WebAssembly by the wall's: on a busy machine only the shortest ones are comparable. Forces are compared bit by bit.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from benches.output import Json, Table, show
from benches.tick import PLATES, local_play, motion_names
from benches.tick_case import Play
from palpate.errors import Error
from palpate.progress import progress_reporter
from palpate.scene import BuiltScene
from palpate.simulation.packed import SCENE_FILE, describe
from palpate.validation.ticks import tick_times
from palpate.viewer.site import find_program

HARNESS = Path(__file__).with_name("web_ticks.mjs")
# A tick in a page may take so many times as long as a native one: measured 0.8 to 1.5.
AIM = 3.0
# Rounds. In a round each side plays once to warm up, and once that is timed.
ROUNDS = 3


@dataclass(frozen=True)
class WebRow:
    """One kind of tick, us.

    Attributes
    ----------
    tick
        What happens in it.
    native, web
        Medians of the shortest times.
    native_costliest, web_costliest
        Largest of the shortest times.
    ratio
        Of the medians.
    same
        Whether all forces are equal to the bit.

    """

    tick: str
    native: float
    web: float
    native_costliest: float
    web_costliest: float
    ratio: float
    same: bool


def measure(name: str) -> WebRow:
    """Play one kind of tick on both sides."""
    play = local_play(PLATES[0], name)
    chosen = np.array(play.kinds) == name
    native, web, same = [], [], True
    with tempfile.TemporaryDirectory() as where:
        folder = Path(where) / "scene"
        folder.mkdir()
        built = BuiltScene(play.simulation.scene, play.simulation.bodies)
        (folder / SCENE_FILE).write_text(json.dumps(describe(built, folder, inside=False)))
        expected = _native_forces(play).tobytes()
        for _ in range(ROUNDS):
            native.append(tick_times(play.simulation, play.path, 2, play.orientation)[1:])
            times, forces = _web_times(play, folder, Path(where))
            web.append(times[1:])
            same &= forces.tobytes() == expected
    here, there = (np.concatenate(times)[:, chosen].min(axis=0) for times in (native, web))
    medians = float(np.median(here)), float(np.median(there))
    return WebRow(name, *medians, float(here.max()), float(there.max()), medians[1] / medians[0], same)


def _web_times(play: Play, folder: Path, where: Path) -> tuple[np.ndarray, np.ndarray]:
    """Play twice in Node: times (2, ticks), us, and forces (ticks, tools, 3), N."""
    path, found, ticks = where / "path.bin", where / "found.bin", len(play.path)
    path.write_bytes(np.ascontiguousarray(play.path).tobytes())
    words = ["node", HARNESS, find_program(), folder, path, found, 2, ticks, *play.orientation]
    ended = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if ended.returncode != 0:
        reasons = [line for line in ended.stderr.splitlines() if "Error: " in line]
        raise Error(f"Node: {reasons[0] if reasons else ended.stderr.strip()}")
    numbers = np.frombuffer(found.read_bytes())
    return numbers[: 2 * ticks].reshape(2, ticks), numbers[2 * ticks :].reshape(play.path.shape)


def _native_forces(play: Play) -> np.ndarray:
    orientations = np.broadcast_to(np.array(play.orientation), (*play.path.shape[:2], 4)).copy()
    grabs = np.zeros(play.path.shape[:2], dtype=bool)
    raw = play.simulation._core.run(play.path, orientations, grabs, ([], []), None)
    return np.asarray(raw["forces"]).reshape(play.path.shape)


def web(as_json: Json = False) -> None:
    """Time ticks in WebAssembly beside native ones. Exit code 1 if forces differ, or one takes three times as long.

    Example: python -m benches web
    """
    if shutil.which("node") is None:
        raise Error("Node is missing: ticks in WebAssembly are timed by it")
    rows, names = [], motion_names()
    with progress_reporter("timing ticks", True) as report:
        for count, name in enumerate(names, 1):
            rows.append(measure(name))
            if report is not None:
                report(count, len(names))
    lines = [
        [
            row.tick,
            *(f"{us:.1f}" for us in (row.native, row.web, row.native_costliest, row.web_costliest)),
            f"{row.ratio:.2f}",
            "yes" if row.same else "no",
        ]
        for row in rows
    ]
    headings = ["tick", "native", "web", "native, costliest", "web, costliest", "ratio", "same bits"]
    show(as_json, rows, Table("Ticks in WebAssembly beside native ones, us", headings, lines))
    if not all(row.same and row.ratio < AIM for row in rows):
        raise typer.Exit(1)
