"""Table 1 of the paper, side by side: its figures, its method on this machine, and Palpate.

The paper's method is the dense inverse of the stiffness matrix of the free dofs, here by LAPACK through numpy; its
Green's functions are columns of that inverse, and a contact is the solve with their 3x3 block.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from palpate import models
from palpate.body import Body, Material
from palpate.green import GreensFunction, precompute
from palpate.scene import YOUNGS_MODULUS, BuiltScene, Scene
from palpate.simulation import Simulation

Made = TypeVar("Made")
NAMES = ("doll", "kidney", "liver")
# Ticks of the timed press, and repeats of everything that takes microseconds.
TICKS = 20_000
REPEATS = 300


@dataclass(frozen=True)
class Row:
    """One model. Times in the unit of the name; ``difference`` is relative, between both methods' forces."""

    model: str
    paper_nodes: int
    nodes: int
    paper_tets: int
    tets: int
    paper_surface_nodes: int | None
    surface_nodes: int
    paper_surface_triangles: int | None
    surface_triangles: int
    paper_precompute_s: float
    dense_precompute_s: float
    precompute_s: float
    precompute_ratio: float
    paper_simulation_us: float
    dense_simulation_us: float
    force_us: float
    force_and_surface_us: float
    difference: float


def run(report: Callable[[str], None] = lambda _: None) -> list[Row]:
    """Measure all models; ``report`` is told what is being done."""
    return [_measure(name, report) for name in NAMES]


def as_json(rows: list[Row]) -> dict:
    """Everything as plain data, with what it was measured on."""
    return {"machine": machine(), "rows": [asdict(row) for row in rows]}


def machine() -> dict[str, str | int]:
    """Return what a benchmark runs on."""
    import os
    import platform

    return {"processor": platform.processor() or platform.machine(), "cores": len(os.sched_getaffinity(0))}


def _measure(name: str, report: Callable[[str], None]) -> Row:
    mesh, published = models.load(name, paper=True), models.PAPER[name]
    body = Body(mesh, material=Material(YOUNGS_MODULUS[name], 0.45), fixed=models.fixed(name, mesh))
    report(f"{name}: Palpate")
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        store = Path(folder) / f"{name}.palpate"
        ours, green = _best(lambda: _fresh(body, store), 3)
        force_us, surface_us = _tick_times(green, store)
        report(f"{name}: the dense inverse")
        dense, (inverse, rank) = _best(lambda: _dense_inverse(body), 2)
        dense_us, difference = _dense_contact(green, inverse, rank)
    return Row(
        name,
        published.nodes,
        len(mesh.nodes),
        published.tets,
        len(mesh.tets),
        published.surface_nodes,
        len(mesh.surface_nodes),
        published.surface_triangles,
        len(mesh.surface_triangles),
        60.0 * (published.precompute_minutes or np.nan),
        dense,
        ours,
        dense / ours,
        1e3 * (published.simulation_ms or np.nan),
        dense_us,
        force_us,
        force_us + surface_us,
        difference,
    )


def _best(work: Callable[[], Made], repeats: int) -> tuple[float, Made]:
    """Shortest time of some repeats, s, for both methods alike: other programs only ever add to it."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        made = work()
        times.append(time.perf_counter() - started)
    return min(times), made


def _fresh(body: Body, store: Path) -> GreensFunction:
    """All of Palpate's work, the file on the disk and its verification included."""
    store.unlink(missing_ok=True)
    return precompute(body, path=store, progress=False)


def _dense_inverse(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of the stiffness of the free dofs, and each dof's row in it (-1: fixed)."""
    stiffness = body.stiffness()
    free = np.setdiff1d(np.arange(stiffness.shape[0]), body.fixed_dofs)
    rank = np.full(stiffness.shape[0], -1)
    rank[free] = np.arange(len(free))
    return np.linalg.inv(stiffness[free][:, free].toarray()), rank


def _dense_contact(green: GreensFunction, inverse: np.ndarray, rank: np.ndarray) -> tuple[float, float]:
    """Time of one node's contact with the whole surface by the paper's method, us, and its force against ours."""
    node = _pressed_node(green)
    rows = rank[(3 * green.surface_nodes[:, None] + np.arange(3)).ravel()]
    surface = inverse[rows[rows >= 0]]  # what the paper keeps: the surface's rows
    columns = rank[3 * node + np.arange(3)]
    press = np.array([0.0, 0.0, -1e-3])

    def contact() -> tuple[np.ndarray, np.ndarray]:
        force = np.linalg.solve(inverse[np.ix_(columns, columns)], press)
        return force, surface[:, columns] @ force

    took = _median_us(contact)
    force = contact()[0]
    answer = green.solve(displacements={node: tuple(press)})
    ours = answer.forces[np.searchsorted(green.surface_nodes, node)]
    return took, float(np.abs(force - ours).max() / np.abs(force).max())


def _tick_times(green: GreensFunction, store: Path) -> tuple[float, float]:
    """Time of one 1 kHz tick with a contact, safety stage included, and of the whole surface of a frame, us."""
    scene = Scene.of_store(store)
    simulation = Simulation(BuiltScene.of(scene, None, green))
    top = green.surface_positions[np.searchsorted(green.surface_nodes, _pressed_node(green))]
    centre = top + [0.0, 0.0, simulation.scene.tools[0].radius]
    depth = np.linspace(0.0, 2e-3, TICKS)
    path = centre - depth[:, None] * [0.0, 0.0, 1.0]
    simulation.run(path[:100])
    started = time.perf_counter()
    simulation.run(path)
    force_us = 1e6 * (time.perf_counter() - started) / TICKS
    with simulation:
        simulation.move(path[-1])
        time.sleep(0.3)
        return force_us, _median_us(simulation.frame)


def _pressed_node(green: GreensFunction) -> int:
    """Highest free surface node."""
    free = ~np.isin(green.surface_nodes, green.fixed_nodes)
    return int(green.surface_nodes[np.argmax(np.where(free, green.surface_positions[:, 2], -np.inf))])


def _median_us(work: Callable[[], object]) -> float:
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1e6 * float(np.median(times))
