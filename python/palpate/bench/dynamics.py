"""Table 2 of the paper, side by side: its figures, its method on this machine, sparse solvers, and Palpate.

All step the same matrices with the same damping by average acceleration. The others move every node at every step.
Palpate's tick moves every mode, reads a patch of ten surface nodes, solves its 3x3 contact and applies its force; the
surface is evaluated as often as it is drawn. "Sliding" gathers the patch anew at every tick, "holding" keeps it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from palpate import _native, models
from palpate.bench import peers
from palpate.bench.paper import machine
from palpate.body import Body, Material
from palpate.cli.catalogue import YOUNGS_MODULUS
from palpate.dynamics import ModalBasis, Newmark, modes, rayleigh_from_ratios
from palpate.dynamics.matrices import Matrices
from palpate.mesh import TetMesh

DT = 1e-3
# A tenth of critical damping at 2 Hz and at 100 Hz: soft tissue comes to rest within a second.
DAMPING = (0.1, 2.0, 0.1, 100.0)
PATCH_NODES = 10
# Spring between tool and patch, N/m.
COUPLING = 500.0
TICKS = 100
# Above so many dofs the dense inverse would take hours and gigabytes.
DENSE_DOFS = 6000


@dataclass(frozen=True)
class Row:
    """One model; None where something was not measured. ``difference``: displacements against SuperLU's, relative."""

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
    sliding_us: float
    holding_us: float
    surface_us: float
    sliding_times_dense: float | None
    sliding_times_sparse: float
    holding_times_dense: float | None
    holding_times_sparse: float
    difference: float


def run(large: bool = False, report: Callable[[str], None] = lambda _: None) -> list[Row]:
    """Measure all models; ``large`` adds a liver of 20,000 nodes; ``report`` is told what is being done."""
    rows = []
    for name, published in (("beam", "beam"), ("liver_dynamic", "liver_dynamic"), ("liver", None)):
        mesh = models.load(name, paper=True)
        report(name)
        rows.append(_measure(name, mesh, models.PAPER[published] if published else None, None))
    if large:
        report("liver of 20,000 nodes")
        rows.append(_measure("liver", _large_liver(), None, 200))
    return rows


def as_json(rows: list[Row]) -> dict:
    """Everything as plain data, with what it was measured on."""
    return {"machine": machine(), "rows": [asdict(row) for row in rows]}


def _measure(name: str, mesh: TetMesh, published: models.PaperModel | None, count: int | None) -> Row:
    modulus = YOUNGS_MODULUS[name.removesuffix("_dynamic")]
    body = Body(mesh, material=Material(modulus, 0.45), fixed=models.fixed(name, mesh))
    rayleigh = rayleigh_from_ratios(*DAMPING)
    started = time.perf_counter()
    basis = modes(body, count)
    modes_s = time.perf_counter() - started
    matrices = Matrices.of(body, "consistent")
    steppers = {n: _stepper(matrices, rayleigh, make) for n, make in peers.installed().items()}
    sparse = {n: _step_us(stepper, matrices, body) for n, stepper in steppers.items()}
    dense = None
    if len(matrices.free) <= DENSE_DOFS:
        dense = _step_us(_stepper(matrices, rayleigh, peers.dense_inverse), matrices, body)
    own = Newmark(body, DT, rayleigh=rayleigh, method="sparse")
    sliding, holding, surface = _tick_us(body, basis, rayleigh)
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
        own_sparse_step_us=_per_call_us(lambda: own.step({_top(body): (0, 0, -0.1)}, 20), 20),
        sliding_us=sliding,
        holding_us=holding,
        surface_us=surface,
        sliding_times_dense=dense / sliding if dense else None,
        sliding_times_sparse=min(sparse.values()) / sliding,
        holding_times_dense=dense / holding if dense else None,
        holding_times_sparse=min(sparse.values()) / holding,
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


def _tick_us(body: Body, basis: ModalBasis, rayleigh: tuple[float, float]) -> tuple[float, float, float]:
    """Time of a tick with a sliding and with a held patch, and of the whole surface."""
    shapes = basis.shapes.reshape(-1, len(basis))
    rest = np.zeros(len(basis))
    motion = _native.ModalMotion(basis.eigenvalues, shapes, (DT, 0.25, 0.5, *rayleigh), False, rest, rest)
    surface = body.mesh.surface_nodes
    distance = np.linalg.norm(body.mesh.nodes[surface] - body.mesh.nodes[_top(body)], axis=1)
    patch = [(3 * int(node), 1.0 / PATCH_NODES) for node in surface[np.argsort(distance)[:PATCH_NODES]]]
    targets = np.zeros((TICKS, 3))
    targets[:, 2] = -1e-3 * np.sin(np.linspace(0, 20, TICKS))
    held = [_per_call_us(lambda s=s: motion.press(patch, targets, COUPLING, s), TICKS) for s in (True, False)]
    rows = (3 * surface[:, None] + np.arange(3)).ravel().tolist()
    return *held, _per_call_us(lambda: motion.at(rows, 0), 1)


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
    import tempfile
    from pathlib import Path

    import trimesh

    from palpate.mesh import tetrahedralize

    mesh = models.liver()
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        surface = Path(folder) / "liver.stl"
        trimesh.Trimesh(mesh.nodes, mesh.surface_triangles).export(surface)
        return tetrahedralize(surface, 0.0034)


def _per_call_us(work: Callable[[], object], calls: int, rounds: int = 100) -> float:
    """Shortest time of one of the ``calls`` that ``work`` makes, us: other programs only ever add to it."""
    work()
    times = []
    for _ in range(rounds):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1e6 * min(times) / calls
