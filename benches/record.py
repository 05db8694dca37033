"""A scripted session recorded at its real rate: what the recorder loses and writes, and whether it is made again.

Every tool comes, presses, holds, slides, lifts and rests, one after the other; bodies in motion are struck; now and
then everything is let go of. Targets come at the rate of a pointer, as in the page.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benches.output import Json, Table, show
from palpate.progress import progress_reporter, status_line
from palpate.scene import BuiltScene, Scene
from palpate.simulation import Recording, Simulation, replay

POINTER_RATE = 120.0
# Seconds of each part of a cycle: come, press, hold, slide there and back, lift, rest.
PARTS = {"come": 0.5, "press": 1.0, "hold": 1.5, "slide": 2.0, "lift": 0.5, "rest": 2.5}
CYCLE = sum(PARTS.values())
# Depth of the press and length of the slide over the body's longest side.
DEPTH, SLIDE = 0.03, 0.1
# Seconds between two strikes of a body in motion, and between two resets.
STRIKE_EVERY, RESET_EVERY = 5.0, 60.0
STRIKE = 2e-3  # N s


@dataclass(frozen=True)
class SessionResult:
    """What a session left.

    Attributes
    ----------
    scene
        Its name.
    seconds
        How long it was.
    ticks, dropped
        Written, and left out.
    missed_computing, missed_waking
        Deadlines that passed while a tick computed, and because one began late.
    not_finite
        Ticks with a force or torque that is not a number.
    contacts
        Ticks with a contact.
    mb_per_minute
        Size of the file.
    longest_us
        Time of its thread that the longest tick takes when made again, us: beyond a period of the loop it would have
        missed a deadline by itself; what is missed beyond that, other programs have caused.
    same
        Whether every bit came out again.

    """

    scene: str
    seconds: float
    ticks: int
    dropped: int
    missed_computing: int
    missed_waking: int
    not_finite: int
    contacts: int
    mb_per_minute: float
    longest_us: float
    same: bool


class Script:
    """Targets of the tools of a scene over the time."""

    def __init__(self, simulation: Simulation):
        self._simulation = simulation
        self._tools = simulation.scene.tools
        self._places = [self._place(rank) for rank in range(len(self._tools))]

    def _place(self, tool: int) -> tuple[int, np.ndarray, np.ndarray, float]:
        """Body, point on it that the tool begins at, m, direction of its slide, and longest side of the body, m."""
        bodies = self._simulation.bodies
        body = tool % len(bodies)
        nodes = bodies[body].points_to_scene(bodies[body].green.surface_positions)
        size = float(np.ptp(nodes, axis=0).max())
        top = np.flatnonzero(nodes[:, 2] > nodes[:, 2].max() - 0.05 * size)
        # Tools on one body keep apart.
        along = nodes[top, 0]
        share = (1 + tool // len(bodies)) / (2 + (len(self._tools) - 1) // len(bodies))
        wanted = along.min() + share * np.ptp(along)
        point = nodes[top[np.abs(along - wanted).argmin()]]
        return body, point, np.array([0.0, 1.0, 0.0]), size

    def move(self, at: float) -> None:
        """Send every tool where it is at a time, s."""
        for tool in range(len(self._tools)):
            self._move(tool, (at + tool * CYCLE / len(self._tools)) % CYCLE)

    def _move(self, tool: int, phase: float) -> None:
        body, point, direction, size = self._places[tool]
        parts = iter(PARTS.items())
        name, length = next(parts)
        while phase >= length:
            phase, (name, length) = phase - length, next(parts)
        share = phase / length
        if name == "rest":
            self._simulation.remove(tool)
            return
        depth = {"come": 0.2 * (share - 1), "press": share, "hold": 1.0, "slide": 1.0, "lift": 1 - 1.2 * share}[name]
        slid = 0.5 * (1 - np.cos(2 * np.pi * share)) if name == "slide" else 0.0
        over = point + slid * SLIDE * size * direction
        foot, normal, _ = self._simulation.closest(over[None], body)
        sticks = not np.isfinite(foot).all()
        foot, normal = (over, np.array([0.0, 0.0, 1.0])) if sticks else (foot[0], normal[0])
        self._simulation.move(foot + (self._tools[tool].reach - depth * DEPTH * size) * normal, tool=tool)


def run_session(
    built: BuiltScene,
    name: str,
    path: Path,
    seconds: float,
    pace: float = 1.0,
    report: Callable[[int, int], None] | None = None,
) -> SessionResult:
    """Record a scripted session of a scene in a new file, at its real rate, and make it again.

    Hands move ``pace`` times as fast as people do.
    """
    with Simulation(built) as simulation:
        simulation.record(path)
        script, start, struck, resets = Script(simulation), time.monotonic(), 0, 0
        moves = any(body.motion is not None for body in built.bodies)
        while (at := time.monotonic() - start) < seconds:
            script.move(pace * at)
            if moves and pace * at > (struck + 1) * STRIKE_EVERY:
                struck += 1
                simulation.strike(
                    built.bodies[0].points_to_scene(built.bodies[0].green.surface_positions)[0], (0, 0, -STRIKE)
                )
            if pace * at > (resets + 1) * RESET_EVERY:
                resets += 1
                simulation.reset()
            if report is not None:
                report(int(at), int(seconds))
            time.sleep(1.0 / POINTER_RATE)
        statistics = simulation.frame().statistics
        done = simulation.stop_recording()
    recording = Recording.load(path)
    replayed = replay(recording, built)
    finite = np.isfinite(recording.forces).all(axis=-1) & np.isfinite(recording.torques).all(axis=-1)
    return SessionResult(
        scene=name,
        seconds=seconds,
        ticks=len(recording.ticks),
        dropped=-1 if done is None else done.dropped,
        missed_computing=statistics["missed_computing"],
        missed_waking=statistics["missed_deadlines"] - statistics["missed_computing"],
        not_finite=int((~finite).sum()),
        contacts=len(np.unique(recording.contacts["tick"])),
        mb_per_minute=path.stat().st_size / 1e6 / seconds * 60,
        longest_us=replayed.longest_us,
        same=replayed.same,
    )


def as_table(results: Sequence[SessionResult]) -> Table:
    """Return one line per scene."""
    headings = ["scene", "ticks", "touching", "dropped", "computing", "waking", "not finite"]
    headings += ["longest", "MB/min", "same"]
    lines = []
    for r in results:
        counts = (r.ticks, r.contacts, r.dropped, r.missed_computing, r.missed_waking, r.not_finite)
        figures = (f"{r.longest_us:.0f} us", f"{r.mb_per_minute:.2f}", "yes" if r.same else "NO")
        lines.append([r.scene, *map(str, counts), *figures])
    notes = [
        "computing, waking: deadlines missed by ticks that took too long, and by late ones; other programs cause both",
        "longest: what the longest tick takes of its own thread's time when the session is made again",
    ]
    return Table("Recorded sessions", headings, lines, notes=notes)


def record(
    scenes: Annotated[list[Path], typer.Argument(help="Scene files (.toml).")],
    minutes: Annotated[float, typer.Option(min=0.01, help="Length of each session.")] = 1.0,
    as_json: Json = False,
) -> None:
    """Record a scripted session of each scene at its real rate, and make it again bit by bit.

    Example: python -m benches record examples/block.toml examples/two_bodies.toml --minutes 10
    """
    results = []
    for scene in scenes:
        read = Scene.read(scene)
        with status_line(f"preparing {read.name}"):
            built = read.build()
        with tempfile.TemporaryDirectory() as folder, progress_reporter(read.name, True) as report:
            results.append(run_session(built, scene.stem, Path(folder) / "session.mcap", 60 * minutes, report=report))
    show(as_json, results, as_table(results))
