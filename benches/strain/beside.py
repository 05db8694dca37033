"""``python -m benches strain``: forces of the laws at large strain beside full Newton's method."""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import palpate
from benches.output import Json, Out, Table, make_folder, print_written, show
from benches.strain.bodies import CELL, Pressed, cuboids, cylinders, liver
from benches.strain.cylinders import RADIUS
from benches.strain.elements import lacking_rows
from benches.strain.elements import table as elements_table
from benches.strain.peers import beside_peers, left_out
from benches.strain.peers import table as peers_table
from benches.strain.sharp_edge import pairs
from benches.strain.sharp_edge import plot as plot_slips
from benches.strain.sharp_edge import table as slips_table
from benches.strain.ticks import sliding_ticks
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_series
from palpate.simulation import Simulation
from palpate.validation.verify.contact.loop import UNLIMITED, sphere

# Distance between ticks of a press, m, and the height from which it starts.
TICK, START = 2e-5, 5e-4
# Radius around the place that may be touched, and how far below it, over the sphere's radius: with less, the patches
# of the liver's large elements would be cut off at the end of it.
TOUCHED, DEEP = 6.0, 4.0


@dataclass(frozen=True)
class Row:
    """Errors of the force at the depths, relative; `stated` is that of B.

    `unsolved` are depths, m, at which full Newton's method does not converge.
    """

    name: str
    nodes: int
    depths: list[float]
    full: list[float]
    linear: list[float]
    local: list[float]
    series: list[float]
    stated: list[float]
    unsolved: list[float]


def pressed(case: Pressed, law: str, series: bool, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return forces along the normal, N, and stated errors at the depths of a case."""
    body = case.body(law)
    surface = body.mesh.surface_nodes
    offset = body.mesh.nodes[surface] - case.place
    near = (np.linalg.norm(offset, axis=1) < TOUCHED * RADIUS) & (offset @ case.normal > -DEEP * RADIUS)
    green = palpate.precompute(body, touch=surface[near], path=folder / f"{law}.palpate", progress=False)
    table = {"name": "body", "model": "liver"}  # the table asks for a source; the body is given
    scene = Scene(body=table, tool=[sphere(RADIUS, 0.0)], device=UNLIMITED, view={"strain_limit": 0.0})
    built = BuiltScene.of(scene, body, green)
    down = np.arange(-START, case.depths[-1] + TICK, TICK)
    path = case.place + (RADIUS - down)[:, None] * case.normal
    recording = Simulation(with_series(built) if series else built).play(path)
    forces = recording.forces[:, 0] if recording.forces.ndim == 3 else recording.forces
    contacts = recording.contacts
    stated = np.interp(case.depths, down[contacts["tick"].astype(int)], contacts["error"])
    return np.interp(case.depths, down, forces @ case.normal), stated


def measure(case: Pressed) -> Row:
    """Press a body by all laws."""
    full = case.full()
    with tempfile.TemporaryDirectory() as folder:
        laws = [("linear", False), ("neo-hookean", False), ("neo-hookean", True)]
        found = [pressed(case, law, series, Path(folder)) for law, series in laws]
    count = len(full)
    errors = [(force[:count] / full - 1.0).tolist() for force, _ in found]
    return Row(
        case.name,
        len(case.mesh.nodes),
        case.depths[:count].tolist(),
        full.tolist(),
        *errors,
        found[2][1][:count].tolist(),
        case.depths[count:].tolist(),
    )


def cases(cell: float, only: str, places: int) -> Iterator[Pressed]:
    """Return the bodies whose name begins with one of the words."""
    for case in itertools.chain(cylinders(cell), cuboids(), liver(places)):
        if case.name.startswith(tuple(only.split(","))):
            yield case


def table(rows: list[Row]) -> Table:
    """Table of errors in per cent."""
    percent = lambda errors: ", ".join(f"{100 * error:+.1f}" for error in errors)  # noqa: E731
    lines = [
        [
            row.name,
            str(row.nodes),
            ", ".join(f"{1e3 * depth:.3g}" for depth in row.depths),
            *map(percent, (row.linear, row.local, row.series)),
            ", ".join(f"{100 * error:.0f}" for error in row.stated),
        ]
        for row in rows
    ]
    headings = ["body", "nodes", "depth, mm", "linear, %", "A, %", "B, %", "stated of B, %"]
    unsolved = {row.name: ", ".join(f"{1e3 * depth:.3g}" for depth in row.unsolved) for row in rows if row.unsolved}
    notes = [f"{name}: full Newton's method does not converge at {depths} mm" for name, depths in unsolved.items()]
    return Table("Error of the force beside full Newton", headings, lines, notes=notes)


def plot(rows: list[Row], path: Path) -> None:
    """Plot the largest error of each body by law."""
    from palpate.figures import COLORS, empty_figure, write_figure

    figure = empty_figure(7.0, 1.0 + 0.32 * len(rows))
    axes = figure.add_subplot()
    place = np.arange(len(rows))[::-1]
    laws = ((0.27, "linear", "linear"), (0.0, "local", "A"), (-0.27, "series", "B"))
    for color, (shift, law, label) in zip(COLORS, laws, strict=False):
        largest = [100 * max(map(abs, getattr(row, law)), default=0.0) for row in rows]
        axes.barh(place + shift, largest, height=0.25, label=label, color=color)
    axes.set_yticks(place, [row.name for row in rows])
    axes.set_xlabel("largest error of the force, %")
    axes.legend(frameon=False)
    write_figure(figure, path)


def strain(
    as_json: Json = False,
    out: Out = None,
    cell: Annotated[float, typer.Option(help="Edges of elements below the sphere, m, on cylinders.")] = CELL,
    only: Annotated[str, typer.Option(help="Bodies whose names begin so, separated by commas.")] = "",
    places: Annotated[int, typer.Option(help="Places on the liver.")] = 10,
    ticks: Annotated[bool, typer.Option("--ticks", help="Time sliding ticks of A and B instead.")] = False,
    peers: Annotated[bool, typer.Option("--peers", help="Press a column by MuJoCo and Drake instead.")] = False,
    elements: Annotated[bool, typer.Option("--elements", help="Measure what elements lack of a half-space.")] = False,
    edge: Annotated[
        bool, typer.Option("--edge", help="Carry a sphere and a capsule over a sharp edge instead.")
    ] = False,
) -> None:
    """Press spheres into neo-Hookean bodies: errors of the linear law, A and B beside full Newton solutions.

    Example: python -m benches strain --only block,column
    """
    if ticks:
        for row in sliding_ticks():
            of_all = f"median {row.median:.1f}, 99.9 % {row.p999:.1f}, worst {row.worst:.0f}"
            shortest = f"shortest of each tick's plays: median {row.shortest:.1f}, costliest {row.costliest:.1f}"
            print(f"{row.labels['law']}, sliding, us: {of_all}; {shortest}")
        return
    if elements:
        lacking = list(lacking_rows())
        show(as_json, lacking, elements_table(lacking))
        return
    if edge:
        carried, folder = list(pairs()), make_folder(out)
        slips = [pair.row() for pair in carried]
        show(as_json, slips, slips_table(slips))
        if folder is not None:
            plot_slips(carried, folder / "edge-slips.png")
            print_written(folder / "edge-slips.png")
        return
    if peers:
        found = beside_peers()
        show(as_json, found, peers_table(found), left_out=left_out())
        return
    folder, rows = make_folder(out), []
    for case in cases(cell, only, places):
        rows.append(measure(case))
        print(f"{case.name}: largest error of B {100 * max(map(abs, rows[-1].series)):.1f} %", file=sys.stderr)
    show(as_json, rows, table(rows))
    if folder is not None and rows:
        plot(rows, folder / "strain.png")
        print_written(folder / "strain.png")
