"""Table 1 of the paper, side by side: its figures, its method on this machine, and Palpate.

The paper's method is the dense inverse of the stiffness matrix of the free dofs, here by LAPACK through numpy; its
Green's functions are columns of that inverse, and a contact is the solve with their 3x3 block.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from benches.output import Json, Table, show, transposed
from benches.timing import call_times
from palpate import models
from palpate.body import Body, Material
from palpate.green import GreensFunction, precompute
from palpate.progress import status_line
from palpate.scene import YOUNGS_MODULUS, BuiltScene, Scene
from palpate.simulation import Simulation

Result = TypeVar("Result")
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


def run() -> list[Row]:
    """Measure all models."""
    return [_measure(name) for name in NAMES]


def _measure(name: str) -> Row:
    mesh, published = models.load(name, paper=True), models.PAPER[name]
    body = Body(mesh, material=Material(YOUNGS_MODULUS[name], 0.45), fixed=models.fixed(name, mesh))
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        store = Path(folder) / f"{name}.palpate"
        ours, green = _best(lambda: _fresh(body, store), 3)
        force_us, surface_us = _tick_times(green, store)
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


def _best(work: Callable[[], Result], repeats: int) -> tuple[float, Result]:
    """Shortest time of some repeats, s, for both methods alike: other programs only ever add to it."""
    results: list[Result] = []
    times = call_times(lambda: results.append(work()), repeats)
    return 1e-6 * float(times.min()), results[-1]


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
    return float(np.median(call_times(work, REPEATS)))


def as_table(rows: list[Row]) -> Table:
    """Lines as in table 1 of the paper."""

    def line(title: str, cell: Callable[[Row], object]) -> tuple[str, list[str]]:
        return title, [str(cell(row)) for row in rows]

    lines = [
        line("nodes: paper", lambda r: r.paper_nodes),
        line("nodes: here", lambda r: r.nodes),
        line("tetrahedra: paper", lambda r: r.paper_tets),
        line("tetrahedra: here", lambda r: r.tets),
        line("surface nodes: paper", lambda r: r.paper_surface_nodes),
        line("surface nodes: here", lambda r: r.surface_nodes),
        line("surface triangles: paper", lambda r: r.paper_surface_triangles),
        line("surface triangles: here", lambda r: r.surface_triangles),
        None,
        line("precompute: paper, Pentium 4", lambda r: f"{r.paper_precompute_s / 60:.1f} min"),
        line("precompute: its dense inverse here", lambda r: f"{r.dense_precompute_s:.2f} s"),
        line("precompute: Palpate", lambda r: f"{r.precompute_s:.2f} s"),
        line("  times faster than its method here", lambda r: f"{r.precompute_ratio:.1f}"),
        None,
        line("contact and surface: paper, Pentium 4", lambda r: f"{r.paper_simulation_us:.0f} us"),
        line("contact and surface: its method here", lambda r: f"{r.dense_simulation_us:.1f} us"),
        line("force alone, one tick: Palpate", lambda r: f"{r.force_us:.2f} us"),
        line("force and whole surface: Palpate", lambda r: f"{r.force_and_surface_us:.1f} us"),
        None,
        line("force of both methods, relative difference", lambda r: f"{r.difference:.0e}"),
    ]
    note = "force alone: patch contact with geometry and safety stage, as the 1 kHz loop runs it"
    return transposed("Table 1 of the paper, and here", [row.model for row in rows], lines, [note])


def paper(as_json: Json = False) -> None:
    """Table 1 of the paper: its figures, its method here, and Palpate.

    Example: python -m benches paper --json > paper.json
    """
    with status_line("measuring doll, kidney and liver"):
        rows = run()
    show(as_json, rows, as_table(rows))
