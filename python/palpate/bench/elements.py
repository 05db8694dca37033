"""Which element to choose: error of the felt stiffness against the price of precomputing it.

A cube pressed by a patch of fixed radius, all of its surface touchable. The price is processor time on all threads
together, which other programs hardly disturb, and the size of the store; the error is relative to a converged value.
Time and size do not depend on Poisson's ratio and are measured at the first.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from palpate.green import precompute
from palpate.verify import felt
from palpate.verify.solution import green_of

RATIOS = (0.3, 0.45, 0.49)
CELLS = {False: (4, 6, 8, 12, 16, 20), True: (2, 3, 4, 6, 8, 10)}


@dataclass(frozen=True)
class Row:
    """One mesh with one element; ``errors`` are relative, by Poisson's ratio."""

    element_nodes: int
    cells: int
    nodes: int
    surface_nodes: int
    precompute_cpu_s: float
    store_bytes: int
    errors: dict[float, float]


def run(report: Callable[[str], None] = lambda _: None) -> list[Row]:
    """Measure all meshes; ``report`` is told what is being done."""
    limits = {nu: felt.reference_stiffness(nu) for nu in RATIOS}
    rows = []
    for quadratic, counts in CELLS.items():
        for cells in counts:
            report(f"{10 if quadratic else 4} nodes, {cells} cells a side")
            rows.append(_measure(cells, quadratic, limits))
    return rows


def as_json(rows: list[Row]) -> list[dict]:
    """Everything as plain data."""
    return [asdict(row) for row in rows]


def _measure(cells: int, quadratic: bool, limits: dict[float, float]) -> Row:
    body = felt.block(cells, quadratic, RATIOS[0])
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        store = Path(folder) / "cube.palpate"
        started = time.process_time()
        precompute(body, path=store, progress=False)
        took, size = time.process_time() - started, store.stat().st_size
    errors = {}
    for nu, limit in limits.items():
        body = felt.block(cells, quadratic, nu)
        green = green_of(body, touch=felt.around(body.mesh, felt.TOP))
        errors[nu] = felt.stiffness(green) / limit - 1
    mesh = body.mesh
    return Row(mesh.tets.shape[1], cells, len(mesh.nodes), len(mesh.surface_nodes), took, size, errors)
