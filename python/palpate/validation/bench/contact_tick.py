"""Computing time of a tick of a sliding sphere, beside numpy solving the same 3x3 contact in the same run."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from palpate.simulation import Simulation
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes
from palpate.validation.verify.solution import green_of

RADIUS, DEPTH, FRICTION = 0.01, 1e-3, 0.3
# Plates of 4-node tetrahedra, 5 mm between nodes, with ever more nodes on the surface; cells along each axis.
PLATES = ((18, 18, 6), (40, 40, 4), (68, 68, 4), (94, 94, 4))
SOLVES, TICKS = 2000, 4000


@dataclass(frozen=True)
class TickRow:
    """Slide over a plate.

    Attributes
    ----------
    surface_nodes
        Of the plate; those within 35 mm of the middle of its top may be touched.
    median, worst
        Of the ticks in contact, us: of the shortest time at each place of the path, played several times.
    numpy
        Median of numpy's solve of three equations with the force and its check, us.

    """

    surface_nodes: int
    median: float
    worst: float
    numpy: float


def tick_rows() -> list[TickRow]:
    """Measure all plates."""
    return [_row(cells) for cells in PLATES]


def compute_us(simulation: Simulation, path: np.ndarray) -> np.ndarray:
    """Measure the computing time of every tick of a path (t, 3), us."""
    positions = np.ascontiguousarray(path[:, None])
    upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*positions.shape[:2], 4)).copy()
    raw = simulation._core.run(positions, upright, np.zeros(positions.shape[:2], dtype=bool), [], [])
    return 1e-3 * np.array(raw["compute_ns"], dtype=float)


def _row(cells: tuple[int, int, int]) -> TickRow:
    body = body_on_table(Block(tuple(0.005 * count for count in cells)), cells, quadratic=False)
    green = green_of(body, touch=top_nodes(body, 0.035), precision="f32")
    simulation = loop_of(body, green, [sphere(RADIUS, FRICTION)])
    low, high = body.mesh.bounds
    middle = np.array([*(low + high)[:2] / 2, high[2] + RADIUS - DEPTH])
    slide = straight(middle - (0.02, 0.011, 0), middle + (0.02, 0.011, 0), 0.0456 / TICKS)
    lead = straight(slide[0] + (0, 0, 3e-3), slide[0], 1e-4)
    times = [compute_us(simulation, np.vstack([lead, slide]))[len(lead) :] for _ in range(5)]
    shortest = np.min(times, axis=0)
    return TickRow(len(green.surface_nodes), float(np.median(shortest)), float(shortest.max()), _numpy_us(green))


def _numpy_us(green) -> float:
    """Gather the 3x3 block of a node, solve for the force, displace the node: what one contact is in numpy."""
    node = int(green.touchable_nodes[len(green.touchable_nodes) // 2])
    row = int(np.searchsorted(green.surface_nodes, node))
    columns = [green.solve(forces={node: axis}).displacements for axis in np.eye(3)]
    operator = np.stack([column.ravel() for column in columns], axis=1)
    press, times = np.array([1e-4, 0.0, -DEPTH]), []
    for _ in range(SOLVES):
        started = time.perf_counter_ns()
        compliance = operator[3 * row : 3 * row + 3]
        force = np.linalg.solve(compliance, press)
        compliance @ force
        times.append(time.perf_counter_ns() - started)
    return 1e-3 * float(np.median(times))
