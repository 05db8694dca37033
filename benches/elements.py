"""Which element to choose: error of the felt stiffness against the price of precomputing it.

A patch of fixed radius presses on a cube, and on the built-in liver away from its supports; all of the surface is
touchable. The price is processor time on all threads together, which other programs hardly disturb, and the size of the
store. Errors are relative to a converged value, for the liver to 10-node tetrahedra half as large, and the largest of
six places there. Time and size do not depend on Poisson's ratio and are measured at the first.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benches.output import Json, Out, Table, make_folder, show
from palpate import models
from palpate.body import Body, Material
from palpate.figures import COLORS, empty_figure, write_figure
from palpate.green import precompute
from palpate.mesh import TetMesh, tetrahedralize
from palpate.progress import status_line
from palpate.validation.verify import felt
from palpate.validation.verify.benchmark import green_of, quiet_body

RATIOS = (0.3, 0.45, 0.49)
CELLS = {False: (4, 6, 8, 12, 16, 20), True: (2, 3, 4, 6, 8, 10)}
# The liver is pressed at six places, this far from its supports at least, by a patch of this radius.
PLACES, CLEAR, RADIUS = 6, 0.03, 0.01
# Elements of 4 nodes with as many surface nodes as the built-in liver has, m.
FINE_SIZE = 0.0055

Probe = Callable[[Body], np.ndarray]


@dataclass(frozen=True)
class Row:
    """One mesh with one element; ``errors`` are relative, by Poisson's ratio."""

    body: str
    element_nodes: int
    nodes: int
    surface_nodes: int
    precompute_cpu_s: float
    store_bytes: int
    errors: dict[float, float]


def run() -> list[Row]:
    """Measure all meshes."""
    return [*_cubes(), *_livers()]


def _cubes() -> list[Row]:
    limits = {nu: np.array([felt.reference_stiffness(nu)]) for nu in RATIOS}

    def probe(body: Body) -> np.ndarray:
        return np.array([felt.stiffness(green_of(body, touch=felt.around(body.mesh, felt.TOP)))])

    return [
        _measure("cube", {nu: felt.block(cells, quadratic, nu) for nu in RATIOS}, probe, limits)
        for quadratic, counts in CELLS.items()
        for cells in counts
    ]


def _livers() -> list[Row]:
    import trimesh

    curved = models.liver()
    fine = tetrahedralize(trimesh.Trimesh(curved.nodes, curved.surface_triangles), FINE_SIZE)
    probe = _liver_probe(fine)
    limits = {nu: probe(_liver(fine.to_quadratic(), nu)) for nu in RATIOS}
    meshes = (models.liver(paper=True), fine, curved)
    return [_measure("liver", {nu: _liver(mesh, nu) for nu in RATIOS}, probe, limits) for mesh in meshes]


def _liver(mesh: TetMesh, nu: float) -> Body:
    return quiet_body(mesh, Material(10e3, nu), models.fixed("liver", mesh))


def _liver_probe(mesh: TetMesh) -> Probe:
    """Stiffness along the normals at places of a mesh's surface, for any other mesh of the liver."""
    corners = mesh.nodes[mesh.surface_triangles]
    centres = corners.mean(axis=1)
    supports = mesh.nodes[models.fixed("liver", mesh)]
    away = np.linalg.norm(centres[:, None] - supports, axis=2).min(axis=1) > CLEAR
    chosen = np.random.default_rng(0).choice(np.flatnonzero(away), PLACES, replace=False)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[chosen]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    def probe(body: Body) -> np.ndarray:
        near = np.unique(np.concatenate([felt.around(body.mesh, centres[k]) for k in chosen]))
        green = green_of(body, touch=near, precision="f32")
        presses = [-felt.PRESS * normal for normal in normals]
        forces = [green.touch(centres[k], press, RADIUS).force for k, press in zip(chosen, presses, strict=True)]
        return np.einsum("ki,ki->k", forces, presses) / felt.PRESS**2

    return probe


def _measure(name: str, bodies: dict[float, Body], probe: Probe, limits: dict[float, np.ndarray]) -> Row:
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as folder:
        store = Path(folder) / "body.palpate"
        started = time.process_time()
        precompute(bodies[RATIOS[0]], path=store, progress=False)
        took, size = time.process_time() - started, store.stat().st_size
    errors = {}
    for nu, limit in limits.items():
        off = probe(bodies[nu]) / limit - 1
        errors[nu] = float(off[np.abs(off).argmax()])
    mesh = bodies[RATIOS[0]].mesh
    return Row(name, mesh.tets.shape[1], len(mesh.nodes), len(mesh.surface_nodes), took, size, errors)


def plot(rows: Sequence[Row], path: Path) -> None:
    """Error of the felt stiffness against the price of precomputing, one line an element and Poisson's ratio."""
    figure = empty_figure(9, 4.5)
    left, right = figure.subplots(1, 2, sharey=True)
    for nodes, style in ((4, "o--"), (10, "s-")):
        chosen = [row for row in rows if row.body == "cube" and row.element_nodes == nodes]
        for nu, color in zip(chosen[0].errors, COLORS, strict=False):
            errors = [abs(100 * row.errors[nu]) for row in chosen]
            label = f"{nodes} nodes, nu {nu}"
            left.loglog([row.precompute_cpu_s for row in chosen], errors, style, color=color, label=label)
            right.loglog([1e-6 * row.store_bytes for row in chosen], errors, style, color=color)
    left.set_ylabel("error of the felt stiffness [%]")
    left.set_xlabel("precomputing, processor time [s]")
    right.set_xlabel("store [MB]")
    left.set_title("a patch on a cube, all of it touchable", loc="left")
    left.legend(frameon=False)
    write_figure(figure, path)


def as_table(rows: Sequence[Row]) -> Table:
    """Return one line per mesh, with a rule where body or element change."""
    lines: list[list[str] | None] = []
    for before, row in zip([rows[0], *rows], rows, strict=False):
        if (before.body, before.element_nodes) != (row.body, row.element_nodes):
            lines.append(None)
        sizes = (str(size) for size in (row.element_nodes, row.nodes, row.surface_nodes))
        price = (f"{row.precompute_cpu_s:.2f}", f"{1e-6 * row.store_bytes:.1f}")
        lines.append([row.body, *sizes, *price, *(f"{100 * error:+.1f} %" for error in row.errors.values())])
    headings = ["body", "element", "nodes", "surface", "time [s]", "store [MB]", *(f"nu {nu}" for nu in rows[0].errors)]
    return Table("Price of precomputing, and error of the stiffness felt by a patch", headings, lines)


def elements(out: Out = None, as_json: Json = False) -> None:
    """4-node and 10-node tetrahedra: error of the felt stiffness against the price of precomputing.

    Example: python -m benches elements --out plots
    """
    with status_line("measuring both elements on a cube and on the liver"):
        rows = run()
    show(as_json, rows, as_table(rows))
    if folder := make_folder(out):
        plot(rows, folder / "elements.png")
