"""A sphere pressed into a block whose elements are as large as the sphere, by Palpate and by others.

All take the same 4-node tetrahedra, 10 mm between nodes, and press at the same places of an element: over a node, over
the middles of its edges, inside of its faces. What is right comes from a direct solution on a mesh that resolves the
contact (`verify.contact.reference`). Beside Palpate's local law stands what its own operator gives when the tool is
kept out at the quadrature points of the faces instead (Signorini), and, where they are installed, MuJoCo and Drake.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from palpate.body import Body
from palpate.green import GreensFunction
from palpate.validation.bench import contact_peers
from palpate.validation.bench.contact_tick import KindRow, TickRow, kind_rows, tick_rows
from palpate.validation.plots import plot_contact
from palpate.validation.verify.contact import tools
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.reference import Block, body_on_table, sphere_press, top_nodes
from palpate.validation.verify.contact.signorini import at_the_meshs_points
from palpate.validation.verify.solution import green_of

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
    """All methods beside the truth (depths,), N; costs of ticks; and programs that were not there."""

    truth: np.ndarray
    rows: list[Row]
    ticks: list[TickRow] = field(default_factory=list)
    kinds: list[KindRow] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)


def run(report: Callable[[str], None] = lambda _: None, ticks: bool = True) -> Results:
    """Measure; ``report`` is told what is being done."""
    report("the direct solution")
    truth = np.array([sphere_press(BLOCK, RADIUS, depth).force for depth in DEPTHS])
    rows = []
    for quadratic, name in ((False, COARSE), (True, "10 nodes, 5 mm")):
        report(f"Palpate, {name}")
        rows += _own_rows(body_on_table(BLOCK, CELLS, quadratic=quadratic), name)
    # The points of the mesh's own faces: on the mesh that all take.
    rows = [rows[0], rows[2], rows[1]]
    rows += _peer_rows(report)
    if ticks:
        report("the cost of a tick")
    costs = (tick_rows(), kind_rows()) if ticks else ([], [])
    return Results(truth, rows, *costs, contact_peers.missing())


def as_json(results: Results) -> dict:
    """Everything as plain data, SI."""
    return {
        "radius": RADIUS,
        "depths": list(DEPTHS),
        "truth": results.truth.tolist(),
        "methods": [
            {
                "method": row.method,
                "mesh": row.mesh,
                "forces": row.forces.tolist(),
                "ratios": (row.means / results.truth).tolist(),
                "step_us": row.step_us,
            }
            for row in results.rows
        ],
        "ticks": [asdict(row) for row in results.ticks],
        "kinds": [asdict(row) for row in results.kinds],
        "missing": results.missing,
    }


def plot(results: Results, path: Path) -> None:
    """Force against depth: what is right, and those that took the same elements, with the range of their places."""
    series = {row.method: row.forces for row in results.rows if row.mesh == COARSE and row.method != AT_POINTS}
    plot_contact(np.array(DEPTHS), results.truth, series, path)


def _places(body: Body) -> np.ndarray:
    """Places (n, 2), m, of the tool."""
    low, high = body.mesh.bounds
    cell = (high - low)[0] / CELLS[0]
    return (low + high)[:2] / 2 + cell * PLACES


def _own_rows(body: Body, name: str) -> list[Row]:
    """By the local law, and at the mesh's own points."""
    green = green_of(body, touch=top_nodes(body, WITHIN))
    places = _places(body)
    nodal = [at_the_meshs_points(green, body.mesh, tools.sphere(RADIUS, tuple(place)), DEPTHS) for place in places]
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


def _tick_times(simulation, path: np.ndarray) -> np.ndarray:
    from palpate.validation.bench.contact_tick import compute_us

    return compute_us(simulation, path)[-len(DEPTHS) :]


def _peer_rows(report: Callable[[str], None]) -> list[Row]:
    body = body_on_table(BLOCK, CELLS, quadratic=False)
    rows, mesh, places = [], body.mesh, _places(body)
    found = contact_peers.installed()
    if "MuJoCo" in found:
        report("MuJoCo")
        forces, step = contact_peers.mujoco_forces(mesh, BLOCK.material, RADIUS, places, DEPTHS)
        rows.append(Row("MuJoCo", COARSE, forces, 1e6 * step))
    if "Drake" in found:
        report("Drake")
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
