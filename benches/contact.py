"""A sphere pressed into a block whose elements are as large as the sphere, by Palpate and by others.

All take the same 4-node tetrahedra, 10 mm between nodes, and press at the same places of an element: over a node, over
the middles of its edges, inside of its faces. What is right comes from a direct solution on a mesh that resolves the
contact (`verify.contact.reference`). Beside Palpate's local law stands what its own operator gives when the tool is
kept out at the quadrature points of the faces instead (Signorini), and, where they are installed, MuJoCo and Drake.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benches import contact_peers
from benches.contact_at_points import forces_at_mesh_points
from benches.output import Json, Out, Table, make_folder, show
from palpate.body import Body
from palpate.figures import COLORS, empty_figure, write_figure
from palpate.green import GreensFunction
from palpate.progress import status_line
from palpate.simulation import Simulation
from palpate.validation.ticks import tick_times
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact import tools
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.reference import Block, body_on_table, sphere_press, top_nodes

BLOCK, RADIUS = Block(), 0.01
DEPTHS = (2.5e-4, 5e-4, 1e-3, 1.5e-3, 2e-3)
CELLS = (10, 10, 5)
# Distance from the middle, m, within which nodes may be touched: two spacings beyond the elements that are pressed.
WITHIN = 0.05
# Places of an element of the top around the middle of the block, in cells: a node, middles of edges, insides of faces.
PLACES = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [1 / 3, 2 / 3], [2 / 3, 1 / 3]])
# The elements that all take, and Palpate's operator with the contact of the others.
COARSE, AT_POINTS = "4 nodes, 10 mm", "Signorini at mesh points"
# What Drake's sphere is pushed with, N.
PUSHES = (0.03, 0.1, 0.25, 0.6)


@dataclass(frozen=True)
class Row:
    """A method; forces (places, depths), N.

    Attributes
    ----------
    method
        Its name.
    mesh
        What it was given.
    forces
        At :data:`PLACES` and :data:`DEPTHS`.
    step_us
        Computing time of a tick or step in contact; None where that is not the question.

    """

    method: str
    mesh: str
    forces: np.ndarray
    step_us: float | None = None

    @property
    def means(self) -> np.ndarray:
        """Over the places, (depths,) N."""
        return self.forces.mean(axis=0)

    @property
    def spread(self) -> np.ndarray:
        """Half the range over the places, part of the mean, (depths,)."""
        return np.ptp(self.forces, axis=0) / 2 / self.means


@dataclass(frozen=True)
class Results:
    """All methods beside the truth (depths,), N, and programs that were not there."""

    truth: np.ndarray
    rows: list[Row]
    missing: dict[str, str] = field(default_factory=dict)


def run() -> Results:
    """Measure."""
    truth = np.array([sphere_press(BLOCK, RADIUS, depth).force for depth in DEPTHS])
    rows = []
    for quadratic, name in ((False, COARSE), (True, "10 nodes, 5 mm")):
        rows += _own_rows(body_on_table(BLOCK, CELLS, quadratic=quadratic), name)
    # The points of the mesh's own faces: on the mesh that all take.
    rows = [rows[0], rows[2], rows[1]]
    return Results(truth, [*rows, *_peer_rows()], contact_peers.missing())


def _places(body: Body) -> np.ndarray:
    """Places (n, 2), m, of the tool."""
    low, high = body.mesh.bounds
    cell = (high - low)[0] / CELLS[0]
    return (low + high)[:2] / 2 + cell * PLACES


def _own_rows(body: Body, name: str) -> list[Row]:
    """By the local law, and at the mesh's own points."""
    green = green_of(body, touch=top_nodes(body, WITHIN))
    places = _places(body)
    nodal = [forces_at_mesh_points(green, body.mesh, tools.sphere(RADIUS, tuple(place)), DEPTHS) for place in places]
    local, cost = _local_forces(body, green, places)
    return [Row("Palpate", name, local, cost), Row(AT_POINTS, name, np.array(nodal))]


def _local_forces(body: Body, green: GreensFunction, places: np.ndarray) -> tuple[np.ndarray, float]:
    """Return forces in the tick (places, depths), and its median computing time, us."""
    simulation = loop_of(body, green, [sphere(RADIUS)])
    top = body.mesh.bounds[1, 2] + RADIUS
    forces = []
    for place in places:
        above = np.array([*place, top])
        path = np.vstack([straight(above + (0, 0, 1e-3), above, 5e-5), above - np.outer(DEPTHS, (0, 0, 1))])
        forces.append(simulation.run(path)[-len(DEPTHS) :, 2])
    return np.array(forces), float(np.median(_tick_times(simulation, path)))


def _tick_times(simulation: Simulation, path: np.ndarray) -> np.ndarray:
    return tick_times(simulation, np.ascontiguousarray(path[:, None]), 1)[0, -len(DEPTHS) :]


def _peer_rows() -> list[Row]:
    body = body_on_table(BLOCK, CELLS, quadratic=False)
    rows, mesh, places = [], body.mesh, _places(body)
    found = contact_peers.installed()
    if "MuJoCo" in found:
        forces, step = contact_peers.mujoco_forces(mesh, BLOCK.material, RADIUS, places, DEPTHS)
        rows.append(Row("MuJoCo", COARSE, forces, 1e6 * step))
    if "Drake" in found:
        depths, step = contact_peers.drake_depths(mesh, BLOCK.material, RADIUS, places, PUSHES)
        rows.append(Row("Drake", COARSE, _at_depths(depths, PUSHES), 1e6 * step))
    return rows


def _at_depths(depths: np.ndarray, pushes: Sequence[float]) -> np.ndarray:
    """Interpolate forces (places, :data:`DEPTHS`) between the logarithms of depths (places, pushes) of given ones."""
    wanted = np.log(DEPTHS)
    forces = []
    for row in np.log(depths):
        order = np.clip(np.searchsorted(row, wanted) - 1, 0, len(pushes) - 2)
        slope = np.diff(np.log(pushes))[order] / np.diff(row)[order]
        forces.append(np.exp(np.log(pushes)[order] + slope * (wanted - row[order])))
    return np.array(forces)


def plot(results: Results, path: Path) -> None:
    """Draw force against depth: the truth, and those that took the same elements, with the range of their places."""
    depths, truth = np.array(DEPTHS), results.truth
    figure = empty_figure(7.5, 5.0)
    axes = figure.subplots()
    fine = np.linspace(0, depths[-1], 100)
    power = np.exp(np.interp(np.log(np.maximum(fine, depths[0])), np.log(depths), np.log(truth)))
    power[fine < depths[0]] = truth[0] * (fine[fine < depths[0]] / depths[0]) ** 1.5
    axes.plot(1e3 * fine, power, color="0.1", linewidth=5, alpha=0.35, label="right: resolved mesh, solved directly")
    chosen = [row for row in results.rows if row.mesh == COARSE and row.method != AT_POINTS]
    for row, color in zip(chosen, (COLORS[1], COLORS[0], COLORS[3]), strict=False):
        x = 1e3 * np.concatenate([[0.0], depths])
        low, mean, high = (np.concatenate([[0.0], of(row.forces, axis=0)]) for of in (np.min, np.mean, np.max))
        axes.fill_between(x, low, high, color=color, alpha=0.2, linewidth=0)
        width = 1.8 if row.method == "Palpate" else 1.3
        axes.plot(x, mean, "o-", color=color, markersize=4, linewidth=width, label=row.method)
    axes.set_xlabel("depth of the sphere [mm]")
    axes.set_ylabel("force [N]")
    axes.set_xlim(0, 1.02e3 * depths[-1])
    axes.set_ylim(bottom=0)
    axes.set_title("a rigid sphere, R = 10 mm, pressed into elements of 10 mm, E = 10 kPa", loc="left")
    axes.legend(frameon=False, loc="upper left", title="band: places of an element", alignment="left")
    write_figure(figure, path)


def as_table(results: Results) -> Table:
    """Return one line per depth and one column per method."""
    headings = ["depth", "direct", *(f"{row.method}\n{row.mesh}" for row in results.rows)]
    lines = []
    for i, (depth, force) in enumerate(zip(DEPTHS, results.truth, strict=True)):
        cells = (f"{row.means[i] / force:.2f}\n+-{100 * row.spread[i]:.2g} %" for row in results.rows)
        lines.append([f"{1e3 * depth:g} mm", f"{1e3 * force:.1f} mN", *cells])
    lines.append(["step", "", *("" if row.step_us is None else f"{row.step_us:.1f} us" for row in results.rows)])
    notes = [f"{peer} was left out: pip install {package}" for peer, package in results.missing.items()]
    title = "Force over that of the direct solution; half its range over the places of an element"
    return Table(title, headings, lines, notes=notes)


def contact(out: Out = None, as_json: Json = False) -> None:
    """Force of a sphere on elements larger than the contact: Palpate, MuJoCo and Drake beside a direct solution.

    Peers: pip install 'palpate[bench]'. Example: python -m benches contact --out plots
    """
    with status_line("pressing; with all peers it takes some minutes"):
        results = run()
    more = {"radius": RADIUS, "depths": DEPTHS, "truth": results.truth, "missing": results.missing}
    ratios = {"ratios": [row.means / results.truth for row in results.rows]}
    show(as_json, results.rows, as_table(results), **more, **ratios)
    if folder := make_folder(out):
        plot(results, folder / "contact.png")
