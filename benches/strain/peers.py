"""A sphere pressed deep into one column of 4-node elements by Palpate and by programs for robots.

The forces of full Newton's method are those of fine axisymmetric elements (`strain-references`). MuJoCo's flex is a
Saint Venant-Kirchhoff material, Drake's deformable body a neo-Hookean one.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import palpate
from benches import contact_peers
from benches.output import Table
from benches.strain.cylinders import RADIUS, Cylinder, references
from palpate.scene.series import with_series
from palpate.simulation import Simulation
from palpate.validation.ticks import tick_times
from palpate.validation.verify.contact.loop import sphere

# The body, and the edges of its elements below the sphere, m. At larger ratios of Poisson 4-node elements lock.
COLUMN, CELL = "column 0.3", 0.006
# Loads of Drake over the forces of the reference, between which its force at a depth is interpolated.
LOADS = np.array([0.5, 1.0, 2.0, 3.5])
# Ticks of a press by Palpate.
TICKS = 2000
# Programs that would take part, and why they do not.
NEVER = {"SOFA": "PyPI has no wheel of it"}


@dataclass(frozen=True)
class PeerRow:
    """Errors of the forces beside full Newton's method, relative, and microseconds of a step."""

    program: str
    errors: list[float]
    step: float


def beside_peers() -> list[PeerRow]:
    """Press the column by each program that is installed."""
    (column,) = (case for case in references(CELL) if case.name == COLUMN)
    mesh = column.corner_mesh()
    mesh = palpate.TetMesh(mesh.nodes + np.array([0.0, 0.0, column.height]), mesh.tets)
    material = palpate.Material(10e3, column.nu, density=1000.0)
    arguments = (mesh, material, RADIUS, np.zeros((1, 2)))
    rows = [_palpate(column, True), _palpate(column, False)]
    if "MuJoCo" in contact_peers.installed():
        forces, seconds = contact_peers.mujoco_forces(*arguments, column.depths)
        rows.append(_row("MuJoCo", column, forces[0], seconds))
    if "Drake" in contact_peers.installed():
        loads = np.multiply.outer(LOADS, column.forces).ravel()
        loads.sort()
        depths, seconds = contact_peers.drake_depths(*arguments, loads, "neo-hookean")
        found = np.interp(column.depths, depths[0], loads, right=np.nan)
        rows.append(_row("Drake", column, found, seconds))
    return rows


def left_out() -> dict[str, str]:
    """Programs that took no part, and why."""
    return {name: f"not installed (pip install {package})" for name, package in contact_peers.missing().items()} | NEVER


def _row(program: str, column: Cylinder, forces: np.ndarray, seconds: float) -> PeerRow:
    return PeerRow(program, (np.abs(forces) / column.forces - 1.0).tolist(), 1e6 * seconds)


def _palpate(column: Cylinder, linear: bool) -> PeerRow:
    with tempfile.TemporaryDirectory() as folder:
        forces, _ = column.pressed(Path(folder), linear=linear)
        simulation = Simulation(with_series(column.built(Path(folder), sphere(RADIUS, 0.0), linear)))
        down = np.linspace(0.0005, -column.depths[-1], TICKS)
        path = np.column_stack([0.0 * down, 0.0 * down, RADIUS + down])
        times = tick_times(simulation, path[:, None, :].copy(), 1)[0, TICKS // 10 :]
    return _row(f"Palpate, {4 if linear else 10} nodes", column, forces, 1e-6 * float(np.median(times)))


def table(rows: list[PeerRow]) -> Table:
    """Table of errors in per cent."""
    (column,) = (case for case in references(CELL) if case.name == COLUMN)
    depths = ", ".join(f"{1e3 * depth:.3g}" for depth in column.depths)
    lines = [
        [row.program, ", ".join(f"{100 * error:+.1f}" for error in row.errors), f"{row.step:,.0f}"] for row in rows
    ]
    headings = ["program", f"error of the force at {depths} mm, %", "step, us"]
    notes = [f"{name} is left out: {reason}" for name, reason in left_out().items()]
    return Table("A sphere of 10 mm pressed into a column of 50 mm height and diameter", headings, lines, notes=notes)
