"""One size of `python -m benches scale`, in a process of its own so that its peak of memory is its own.

``python -m benches.scale_row JOB`` takes its job as JSON and prints a line of JSON as each stage
begins, and the row at the end.
"""

from __future__ import annotations

import contextlib
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _native
from palpate.body import Body, Material, description, problem_arrays
from palpate.green import GreensFunction
from palpate.green.bounds import CHOSEN
from palpate.green.resources import memory_in_use
from palpate.mesh import TetMesh, filling, tetrahedralize
from palpate.mesh.tetrahedralize import read_surface
from palpate.simulation import Simulation
from palpate.validation.ticks import CELL, DEPTH, FRICTION, HELD, RADIUS, strokes, tick_times
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.grids import box

# Height over width of a grid; its cells are the same on every size, so that a tool meets the same elements.
HEIGHT = 0.8
# Places are pressed whose surroundings of this radius, m, may be touched, and are as even as this cosine.
AROUND, EVEN = 0.012, 0.95
# Places, and how often they are played.
PLACES, PLAYS = 40, 25
FRAMES = 40
# Part of a surface's height that holds it, from below.
HELD_PART = 0.1


@dataclass(frozen=True)
class Job:
    """What is measured.

    Attributes
    ----------
    tetrahedra
        Wanted number.
    touched
        Nodes that may be touched.
    precision
        Stored number format; None: the body chooses.
    surface
        File that is filled; None: a grid of cubes, each cut into six.
    memory
        Bytes that the process may take; None: any.

    """

    tetrahedra: int
    touched: int = 2000
    precision: str | None = "f16"
    surface: str | None = None
    memory: int | None = None


@dataclass
class Row:
    """One size: times in s, ticks and frames in us, memory and store in bytes.

    Attributes
    ----------
    tetrahedra, nodes, surface_nodes, touched
        Of the body.
    seconds, cpu_seconds
        Of each stage in their order, on the wall and of all processors.
    planned, peak
        Peak of the process's memory while the store is computed and written: planned, and measured.
    peak_whole
        The largest from the beginning to the end.
    store
        Size of the file.
    tick_median, tick_worst, tick_noisy
        Computing time of ticks of presses and slides anywhere in the region: median; the costliest, of which the
        shortest of its plays counts; and the longest of all plays.
    ticks
        Ticks of the script.
    frame
        A frame with the displacements of the whole surface, in contact.

    """

    tetrahedra: int
    nodes: int
    surface_nodes: int
    touched: int
    seconds: dict[str, float] = field(default_factory=dict)
    cpu_seconds: dict[str, float] = field(default_factory=dict)
    planned: int = 0
    peak: int = 0
    peak_whole: int = 0
    store: int = 0
    tick_median: float = 0.0
    tick_worst: float = 0.0
    tick_noisy: float = 0.0
    ticks: int = 0
    frame: float = 0.0


def processor_seconds() -> float:
    """Time of all processors of this process and of the meshers it has ended, s."""
    try:
        from resource import RUSAGE_CHILDREN, getrusage
    except ImportError:
        return time.process_time()
    used = getrusage(RUSAGE_CHILDREN)
    return time.process_time() + used.ru_utime + used.ru_stime


class Stages:
    """Clock of the stages; each ends where the next begins."""

    def __init__(self, report: Callable[[str], None]):
        self.seconds: dict[str, float] = {}
        self.cpu_seconds: dict[str, float] = {}
        self._report, self._name, self._begun = report, "", (0.0, 0.0)

    def begin(self, name: str) -> None:
        """End the stage before, and begin one; an empty name begins none."""
        now = time.perf_counter(), processor_seconds()
        if self._name:
            for totals, end, start in zip((self.seconds, self.cpu_seconds), now, self._begun, strict=True):
                totals[self._name] = totals.get(self._name, 0.0) + end - start
        self._name, self._begun = name, now
        if name:
            self._report(name)


def measure(job: Job, report: Callable[[str], None] = lambda _: None) -> Row:
    """Measure one size in this process; ``report`` is called as each stage begins."""
    stages = Stages(report)
    mesh = make_mesh(job, stages)
    stages.begin("body")
    body = Body(mesh, material=Material(10e3, 0.45), fixed=held_nodes(mesh, job))
    touch = touch_region(mesh, job.touched)
    problem = problem_arrays(body, touch)
    stages.begin("")
    row = Row(len(mesh.tets), len(mesh.nodes), len(mesh.surface_nodes), len(touch))
    allowed = None if job.memory is None else job.memory - memory_in_use()
    row.peak_whole = peak_memory()
    reset_peak()
    used = memory_in_use()
    allowed = None if job.memory is None else job.memory - used
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        path = Path(folder) / "body.palpate"
        what = (job.precision, CHOSEN, json.dumps(description(body)))
        _native.GreenCore.precompute_to(problem, *what, None, path, allowed, phase=stages.begin)
        stages.begin("")
        row.peak, row.store = peak_memory(), path.stat().st_size
        # Afterwards, for what it leaves in the hands of the allocator would be counted again.
        row.planned = used + _native.GreenCore.plan(problem, job.precision, allowed)["memory"]
        stages.begin("opening")
        green = GreensFunction(_native.GreenCore.load(path, None), body)
    press_and_draw(row, body, green, touch, stages)
    row.seconds, row.cpu_seconds = stages.seconds, stages.cpu_seconds
    row.peak_whole = max(row.peak_whole, peak_memory())
    return row


def make_mesh(job: Job, stages: Stages) -> TetMesh:
    """Mesh of a job, with its surface."""
    if job.surface is None:
        stages.begin("meshing")
        width = round((job.tetrahedra / 6 / HEIGHT) ** (1 / 3))
        cells = (width, width, max(1, round(job.tetrahedra / 6 / width**2)))
        mesh = box(cells, CELL * np.array(cells), quadratic=False)
    else:
        stages.begin("reading")
        shape = read_surface(job.surface)
        stages.begin("meshing")
        mesh = tetrahedralize(
            shape, float((filling.IN_CUBE * shape.volume / job.tetrahedra) ** (1 / 3)), time_limit=3600.0
        )
    stages.begin("surface")
    mesh.surface_nodes  # noqa: B018, worked out once and kept
    return mesh


def held_nodes(mesh: TetMesh, job: Job) -> np.ndarray:
    """Nodes that hold the body, (n,) mask: those on the table, or the lowest part of a surface."""
    low, high = mesh.bounds[:, 2]
    return mesh.nodes[:, 2] <= low + (1e-9 if job.surface is None else HELD_PART * (high - low))


def touch_region(mesh: TetMesh, count: int) -> np.ndarray:
    """So many surface nodes, or all, around the highest in the middle, ascending."""
    nodes = mesh.nodes[mesh.surface_nodes]
    middle = nodes.mean(axis=0)
    inner = np.linalg.norm(nodes[:, :2] - middle[:2], axis=1) < 0.2 * np.ptp(nodes[:, :2], axis=0).max()
    top = nodes[inner][nodes[inner, 2].argmax()]
    if inner.any():
        flat = np.isclose(nodes[:, 2], top[2])
        top = nodes[flat][np.linalg.norm(nodes[flat, :2] - middle[:2], axis=1).argmin()]
    nearest = np.argsort(np.linalg.norm(nodes - top, axis=1), kind="stable")[:count]
    return np.sort(mesh.surface_nodes[nearest])


def press_and_draw(row: Row, body: Body, green: GreensFunction, touch: np.ndarray, stages: Stages) -> None:
    """Open, touch, press and slide anywhere in the region, and draw."""
    stages.begin("contact law")
    simulation = loop_of(body, green, [sphere(RADIUS, FRICTION)])
    stages.begin("")
    places, normals = even_places(body.mesh, touch)
    path = script(places, normals)
    stages.begin("first touch")
    tick_times(simulation, path[: 1 + HELD], 1)
    stages.begin("")
    times = tick_times(simulation, path, PLAYS)
    row.ticks, row.tick_median, row.tick_noisy = len(path), float(np.median(times)), float(times.max())
    row.tick_worst = float(times.min(axis=0).max())
    row.frame = frame_us(simulation, path[1, 0])


def even_places(mesh: TetMesh, touch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (p, 3), m, and outward normals (p, 3) spread over the even parts of the region, clear of its border."""
    from scipy.spatial import cKDTree

    nodes = mesh.nodes[mesh.surface_nodes]
    ranks = np.searchsorted(mesh.surface_nodes, mesh.surface_triangles)
    crosses = np.cross(nodes[ranks[:, 1]] - nodes[ranks[:, 0]], nodes[ranks[:, 2]] - nodes[ranks[:, 0]])
    normals = np.zeros_like(nodes)
    for corner in range(3):
        np.add.at(normals, ranks[:, corner], crosses)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    touchable = np.isin(mesh.surface_nodes, touch)
    around = cKDTree(nodes).query_ball_point(nodes[touchable], AROUND)
    own = normals[touchable]
    inside = np.array([touchable[near].all() for near in around])
    evenness = np.array([(normals[near] @ normal).min() for near, normal in zip(around, own, strict=True)])
    evenness[~inside] = -1.0
    # Where nothing is even, the most even there is.
    good = np.flatnonzero(evenness >= min(EVEN, evenness.max()))
    chosen = np.random.default_rng(1).choice(good, min(PLACES, len(good)), replace=False)
    return nodes[touchable][chosen], own[chosen]


def script(places: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Path of the tool's centre over places (p, 3), m, with normals (p, 3): (ticks, 1, 3), m."""
    random = np.random.default_rng(2)
    steps = []
    for place, normal in zip(places, normals, strict=True):
        along = np.cross(normal, random.normal(size=3))
        steps.append(place + (RADIUS - DEPTH) * normal + strokes(along / np.linalg.norm(along), normal))
    return np.ascontiguousarray(np.vstack(steps)[:, None, :])


def frame_us(simulation: Simulation, pressed: np.ndarray) -> float:
    """Median time of a frame of the running loop in contact, us of this process."""
    with simulation:
        simulation.move(pressed)
        for _ in range(200):
            time.sleep(0.01)
            if simulation.contacts():
                break
        times = []
        for _ in range(FRAMES):
            begun = time.thread_time()
            simulation.frame()
            times.append(time.thread_time() - begun)
            time.sleep(0.005)
    return 1e6 * float(np.median(times))


def peak_memory() -> int:
    """Bytes that this process has held at its peak."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


def reset_peak() -> None:
    """Begin the peak anew where the system allows it, so that what a mesh has taken does not count."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def main(text: str) -> None:
    """Measure the job of ``text``, and print stages and row as lines of JSON."""

    def write(**message: Any) -> None:
        print(json.dumps(message), flush=True)

    write(row=asdict(measure(Job(**json.loads(text)), lambda stage: write(stage=stage))))


if __name__ == "__main__":
    _native.end_with_parent(watch_input=False)
    main(sys.argv[1])
