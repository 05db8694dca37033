"""Table 2 of the paper, side by side: its figures, its method on this machine, sparse solvers, and Palpate.

All step the same matrices with the same damping. The others, by average acceleration, move every node at every step.
Palpate's force tick is that of the 1 kHz loop, run offline: geometry, the contact of a patch through its coupling, the
motion of every mode, energy, safety stage; the surface is evaluated as often as it is drawn.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benches import peers
from benches.output import Json, Table, show, transposed
from benches.timing import call_times
from palpate import models
from palpate.body import Body, Material
from palpate.dynamics import ModalBasis, Newmark, modes, rayleigh_from_ratios
from palpate.dynamics.basis import Matrices
from palpate.green import precompute
from palpate.mesh import TetMesh, tetrahedralize
from palpate.progress import status_line
from palpate.scene import YOUNGS_MODULUS, BodyMotion, BuiltScene, Scene
from palpate.simulation import Simulation

DT = 1e-3
# A tenth of critical damping at 2 Hz and at 100 Hz: soft tissue comes to rest within a second.
DAMPING = (0.1, 2.0, 0.1, 100.0)
# The scenes' own weights and coupling, N/m.
ALPHA, DELTA, COUPLING = 0.3025, 0.6, 5000.0
TICKS = 1000
# Radius of the touched part of the surface, m: a tick needs no other columns of Psi.
TOUCHED = 0.02
# Pictures a second of an ordinary screen.
FRAME_RATE = 60.0
# Ticks a second.
TICK_RATE = 1000.0
# Above so many dofs the dense inverse would take hours and gigabytes.
DENSE_DOFS = 6000


@dataclass(frozen=True)
class Row:
    """One model; None where something was not measured.

    ``tick_us`` is a force tick in contact, ``tapping_us`` one of a tool that lands and leaves in turn, ``surface_us``
    the whole surface for a frame. ``frame_times``: all steps between two frames, and for Palpate the surface too.
    ``difference``: displacements against SuperLU's, relative.
    """

    model: str
    paper_nodes: int | None
    nodes: int
    dofs: int
    modes: int
    modes_s: float
    paper_step_ms: float | None
    dense_step_us: float | None
    sparse_step_us: dict[str, float]
    own_sparse_step_us: float
    modal_step_us: float
    tick_us: float
    tapping_us: float
    surface_us: float
    tick_times_dense: float | None
    tick_times_sparse: float
    frame_times_dense: float | None
    frame_times_sparse: float
    difference: float


def run(large: bool = False) -> list[Row]:
    """Measure all models; ``large`` adds a liver of 20,000 nodes."""
    rows = []
    for name, published in (("beam", "beam"), ("liver_dynamic", "liver_dynamic"), ("liver", None)):
        mesh = models.load(name, paper=True)
        rows.append(_measure(name, mesh, models.PAPER[published] if published else None, None))
    if large:
        rows.append(_measure("liver", _large_liver(), None, 200))
    return rows


def _measure(name: str, mesh: TetMesh, published: models.PaperModel | None, count: int | None) -> Row:
    modulus = YOUNGS_MODULUS[name.removesuffix("_dynamic")]
    body = Body(mesh, material=Material(modulus, 0.45), fixed=models.fixed(name, mesh))
    rayleigh = rayleigh_from_ratios(*DAMPING)
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        started = time.perf_counter()
        basis = modes(body, count, path=Path(folder) / "modes.palpate")
        modes_s = time.perf_counter() - started
    matrices, force = Matrices.of(body, "consistent"), {_top(body): (0, 0, -0.1)}
    steppers = {n: _stepper(matrices, rayleigh, make) for n, make in peers.installed().items()}
    sparse = {n: _step_us(stepper, matrices, body) for n, stepper in steppers.items()}
    dense = None
    if len(matrices.free) <= DENSE_DOFS:
        dense = _step_us(_stepper(matrices, rayleigh, peers.dense_inverse), matrices, body)
    own = Newmark(body, DT, rayleigh=rayleigh, method="sparse")
    own_us = _per_call_us(lambda: own.step(force, 20), 20)
    modal = Newmark(body, DT, rayleigh=rayleigh, modes=basis)
    tick, tapping, surface = _tick_us(body, BodyMotion(basis, (DT, ALPHA, DELTA, *rayleigh), False, COUPLING))
    ticks_per_frame = TICK_RATE / FRAME_RATE
    frame = tick + surface / ticks_per_frame
    return Row(
        model=name,
        paper_nodes=published.nodes if published else None,
        nodes=len(mesh.nodes),
        dofs=len(matrices.free),
        modes=len(basis),
        modes_s=modes_s,
        paper_step_ms=1e3 * published.step_seconds if published else None,
        dense_step_us=dense,
        sparse_step_us=sparse,
        own_sparse_step_us=own_us,
        modal_step_us=_per_call_us(lambda: modal.step(force, TICKS), TICKS),
        tick_us=tick,
        tapping_us=tapping,
        surface_us=surface,
        tick_times_dense=dense / tick if dense else None,
        tick_times_sparse=min(sparse.values()) / tick,
        frame_times_dense=dense / frame if dense else None,
        frame_times_sparse=min(sparse.values()) / frame,
        difference=_difference(body, basis, rayleigh, matrices),
    )


def _stepper(matrices: Matrices, rayleigh: tuple[float, float], make) -> peers.Stepper:
    return peers.Stepper(matrices.free_stiffness, matrices.free_mass, rayleigh, DT, make)


def _step_us(stepper: peers.Stepper, matrices: Matrices, body: Body) -> float:
    force = _force(matrices, body)
    return _per_call_us(lambda: stepper.step(force), 1)


def _force(matrices: Matrices, body: Body) -> np.ndarray:
    """0.1 N downwards on the highest node; free dofs."""
    force = np.zeros(matrices.stiffness.shape[0])
    force[3 * _top(body) + 2] = -0.1
    return force[matrices.free]


def _tick_us(body: Body, motion: BodyMotion) -> tuple[float, float, float]:
    """Time of a tick in contact, of one with a tool that lands and leaves in turn, and of the whole surface."""
    surface, top = body.mesh.surface_nodes, body.mesh.nodes[_top(body)]
    near = surface[np.linalg.norm(body.mesh.nodes[surface] - top, axis=1) < TOUCHED]
    green = precompute(body, touch=near, progress=False)
    scene = Scene.of_store(green.path)
    simulation = Simulation(BuiltScene.of(scene, body, green, motion))
    above = top + [0.0, 0.0, simulation.scene.tools[0].radius]
    press = above - np.linspace(0.0, 2e-3, TICKS)[:, None] * [0.0, 0.0, 1.0]
    tap = above + np.where(np.arange(TICKS) % 2, -1e-3, 1e-2)[:, None] * [0.0, 0.0, 1.0]
    ticks = [_per_call_us(lambda path=path: simulation.run(path), TICKS) for path in (press, tap)]
    with simulation:
        simulation.move(press[-1])
        time.sleep(0.3)
        return *ticks, _per_call_us(simulation.frame, 1)


def _difference(body: Body, basis: ModalBasis, rayleigh: tuple[float, float], matrices: Matrices) -> float:
    """Displacements after 50 steps by the modes and by SuperLU."""
    ours = Newmark(body, DT, rayleigh=rayleigh, modes=basis)
    ours.step({_top(body): (0, 0, -0.1)}, 50)
    theirs = _stepper(matrices, rayleigh, peers.superlu)
    for _ in range(50):
        theirs.step(_force(matrices, body))
    moved = ours.displacements.ravel()[matrices.free]
    return float(np.abs(moved - theirs.u).max() / np.abs(theirs.u).max())


def _top(body: Body) -> int:
    """Highest free surface node."""
    free = np.setdiff1d(body.mesh.surface_nodes, body.fixed_nodes)
    return int(free[np.argmax(body.mesh.nodes[free, 2])])


def _large_liver() -> TetMesh:
    """Return the liver filled again by NETGEN with about 20,000 nodes."""
    import trimesh

    mesh = models.liver()
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        surface = Path(folder) / "liver.stl"
        trimesh.Trimesh(mesh.nodes, mesh.surface_triangles).export(surface)
        return tetrahedralize(surface, 0.0034)


def _per_call_us(work: Callable[[], object], calls: int, rounds: int = 100) -> float:
    """Shortest time of one of the ``calls`` that ``work`` makes, us: other programs only ever add to it."""
    work()
    return float(call_times(work, rounds).min()) / calls


def as_table(rows: list[Row]) -> Table:
    """Lines as in table 2 of the paper."""

    def line(title: str, cell: Callable[[Row], float | None], digits: int = 1) -> tuple[str, list[str]]:
        values = [cell(row) for row in rows]
        return title, ["-" if value is None else f"{value:.{digits}f}" for value in values]

    lines = [
        line("nodes: paper", lambda r: r.paper_nodes, 0),
        line("nodes: here", lambda r: r.nodes, 0),
        line("free dofs", lambda r: r.dofs, 0),
        line("modes", lambda r: r.modes, 0),
        None,
        line("paper, Pentium 4", lambda r: r.paper_step_ms and 1e3 * r.paper_step_ms, 0),
        line("its dense inverse here", lambda r: r.dense_step_us),
        *(line(name, lambda r, name=name: r.sparse_step_us.get(name)) for name in peers.SPARSE),
        line("Palpate, all dofs by its sparse factor", lambda r: r.own_sparse_step_us),
        line("Palpate, all modes, a force on a node", lambda r: r.modal_step_us),
        None,
        line("Palpate, force tick in contact", lambda r: r.tick_us),
        line("Palpate, force tick, landing and leaving", lambda r: r.tapping_us),
        line("Palpate, whole surface for a frame", lambda r: r.surface_us),
        line("tick: times faster than the dense inverse", lambda r: r.tick_times_dense, 0),
        line("tick: times faster than the best sparse", lambda r: r.tick_times_sparse, 0),
        line("60 Hz with surface: times dense inverse", lambda r: r.frame_times_dense, 0),
        line("60 Hz with surface: times the best sparse", lambda r: r.frame_times_sparse, 0),
        ("difference from SuperLU after 50 steps", [f"{row.difference:.0e}" for row in rows]),
    ]
    absent = [name for name in peers.SPARSE if name not in rows[0].sparse_step_us]
    notes = [f"not installed: {', '.join(absent)}"] if absent else []
    title = "Table 2 of the paper, and here: one step of 1 ms, in us"
    return transposed(title, [row.model for row in rows], lines, notes)


def dynamics(
    as_json: Json = False,
    large: Annotated[bool, typer.Option("--large", help="Also a liver of 20,000 nodes; takes minutes.")] = False,
) -> None:
    """Table 2 of the paper: one time step by its method, by sparse solvers, and by Palpate.

    CHOLMOD (scikit-sparse) and PARDISO (pypardiso) take part where they are installed.

    Example: python -m benches dynamics --json > dynamics.json
    """
    with status_line("measuring beam and livers in motion"):
        rows = run(large)
    show(as_json, rows, as_table(rows))
