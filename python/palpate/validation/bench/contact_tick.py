"""Computing time of a tick under the local law: of a sliding sphere over ever larger bodies, and of every kind.

Beside them stands numpy in the same run: three equations solved, and the whole contact (`contact_numpy`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.body import Body
from palpate.green import GreensFunction
from palpate.scene import BodyMotion, Scene
from palpate.simulation import Simulation
from palpate.validation.bench.contact_numpy import NumpyContact, regular_compliance
from palpate.validation.verify.contact.loop import UNLIMITED, loop_of, sphere, straight
from palpate.validation.verify.contact.reference import SOFT, Block, body_on_table, top_nodes
from palpate.validation.verify.solution import green_of

RADIUS, DEPTH, FRICTION = 0.01, 1e-3, 0.3
# Plates of 4-node tetrahedra, 5 mm between nodes, with ever more nodes on the surface; cells along each axis.
PLATES = ((18, 18, 6), (40, 40, 4), (68, 68, 4), (94, 94, 4))
SOLVES, TICKS, TIMES = 2000, 4000, 5
# Radius of the patch that `C_reg` of a node is taken over: three mean lengths of the edges at it, m.
WIDTH = 0.017
MODES = 100
# Orientations: as it is, and lying along y.
UPRIGHT, LYING = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.5**0.5, 0.0, 0.0)


@dataclass(frozen=True)
class TickRow:
    """Slide over a plate.

    Attributes
    ----------
    surface_nodes
        Of the plate; those within 35 mm of the middle of its top may be touched.
    median, worst
        Of the ticks in contact, us: of the shortest time at each place of the path, played several times.
    solve
        Median of numpy's solve of three equations with the force and its check, us.
    numpy
        Median of the same slide in numpy, us a tick.

    """

    surface_nodes: int
    median: float
    worst: float
    solve: float
    numpy: float


@dataclass(frozen=True)
class KindRow:
    """One kind of tick on the first plate; us as in :class:`TickRow`."""

    kind: str
    median: float
    worst: float


def tick_rows() -> list[TickRow]:
    """Measure all plates."""
    return [_row(cells) for cells in PLATES]


def kind_rows() -> list[KindRow]:
    """Measure every kind of tick."""
    body, green = _plate(PLATES[0])
    middle = _middle(body)
    ball, slide = sphere(RADIUS, FRICTION), _slide(middle)
    turn = np.arange(TICKS) / TICKS
    up = np.array([0.0, 0.0, 1.0])
    held = np.broadcast_to(middle, slide.shape)
    stick = middle + np.stack([2e-5 * np.sin(60 * turn), 0 * turn, 0 * turn], axis=1)
    taps = slide + np.where(np.arange(TICKS) % 2 == 0, 2 * DEPTH, 0.0)[:, None] * up
    fast = middle + np.stack([0.02 * np.sin(80 * turn), 0 * turn, 0 * turn], axis=1)
    beside = np.stack([slide, slide + (0.0, 0.022, 0.0)], axis=1)
    motion = Scene(body={"model": "liver"}, dynamics={"modes": MODES}).dynamics.build(
        body, UNLIMITED["max_stiffness"], progress=False
    )
    rows = []

    def add(kind: str, tools: list, path: np.ndarray, motion: BodyMotion | None = None, turned=UPRIGHT) -> None:
        simulation = loop_of(body, green, tools, motion=motion)
        lead = np.stack([path[0] + lift * up for lift in np.linspace(3e-3, 0, 31)[:-1]])
        shortest = _shortest(simulation, np.concatenate([lead, path]), turned)[len(lead) :]
        rows.append(KindRow(kind, float(np.median(shortest)), float(shortest.max())))

    add("free, 5 mm above", [ball], slide + 6e-3 * up)
    add("holds", [ball], held)
    add("sticks, 20 um to and fro", [ball], stick)
    add("slides, 11 mm/s", [ball], slide)
    add("slides to and fro, up to 0.4 m/s", [ball], fast)
    add("comes and leaves in turn", [ball], taps)
    add("two spheres slide", [ball, ball], beside)
    add(f"slides on a body in motion, {MODES} modes", [ball], slide, motion)
    for name, (table, lower, turned) in _tools().items():
        add(f"{name} slides", [table], slide - lower * up, turned=turned)
    return rows


def _tools() -> dict[str, tuple[dict, float, Sequence[float]]]:
    """Tables of tools, how far below a sphere's centre their origins are held, m, and how they are turned."""
    common = {"contact": "local", "friction": FRICTION}
    return {
        "ellipsoid": ({"shape": "ellipsoid", "semi_axes": [0.012, 0.009, 0.008], **common}, 0.002, UPRIGHT),
        "capsule (cells)": ({"shape": "capsule", "radius": 0.006, "length": 0.024, **common}, 0.004, LYING),
        "punch (cells)": ({"shape": "punch", "radius": 0.006, "rounding": 0.001, **common}, 0.01, UPRIGHT),
    }


def compute_us(simulation: Simulation, path: np.ndarray, orientation: Sequence[float] = UPRIGHT) -> np.ndarray:
    """Measure the computing time of every tick of a path (t, 3) or (t, tools, 3), us."""
    positions = np.ascontiguousarray(path.reshape(len(path), -1, 3))
    upright = np.broadcast_to(np.array(orientation), (*positions.shape[:2], 4)).copy()
    raw = simulation._core.run(positions, upright, np.zeros(positions.shape[:2], dtype=bool), ([], []), None)
    return 1e-3 * np.array(raw["compute_ns"], dtype=float)


def _shortest(simulation: Simulation, path: np.ndarray, orientation: Sequence[float] = UPRIGHT) -> np.ndarray:
    """Shortest time at each place of a path played several times, us."""
    return np.min([compute_us(simulation, path, orientation) for _ in range(TIMES)], axis=0)


def _plate(cells: tuple[int, int, int]) -> tuple[Body, GreensFunction]:
    body = body_on_table(Block(tuple(0.005 * count for count in cells)), cells, quadratic=False)
    return body, green_of(body, touch=top_nodes(body, 0.035), precision="f32")


def _middle(body: Body) -> np.ndarray:
    """Centre of the sphere that is pressed into the middle of the top, m."""
    low, high = body.mesh.bounds
    return np.array([*(low + high)[:2] / 2, high[2] + RADIUS - DEPTH])


def _slide(middle: np.ndarray) -> np.ndarray:
    """Path (TICKS, 3), m, across the middle."""
    return straight(middle - (0.02, 0.011, 0), middle + (0.02, 0.011, 0), 0.0456 / TICKS)[:TICKS]


def _row(cells: tuple[int, int, int]) -> TickRow:
    body, green = _plate(cells)
    slide = _slide(_middle(body))
    simulation = loop_of(body, green, [sphere(RADIUS, FRICTION)])
    lead = straight(slide[0] + (0, 0, 3e-3), slide[0], 1e-4)
    shortest = _shortest(simulation, np.vstack([lead, slide]))[len(lead) :]
    contact = numpy_contact(green, _middle(body) - (0, 0, RADIUS - DEPTH))
    return TickRow(
        len(green.surface_nodes),
        float(np.median(shortest)),
        float(shortest.max()),
        _solve_us(contact.compliance),
        _median_us(contact.tick, slide[:SOLVES]),
    )


def numpy_contact(green: GreensFunction, point: np.ndarray) -> NumpyContact:
    """Return the contact at a point of a plate's top."""
    compliance = regular_compliance(green, SOFT, point, WIDTH)
    return NumpyContact(compliance, point, np.array([0.0, 0.0, 1.0]), RADIUS, FRICTION, SOFT)


def _solve_us(compliance: np.ndarray) -> float:
    """Solve three equations for a force, and displace by it."""
    operator = np.vstack([np.zeros((3, 3)), compliance])

    def solve(press: np.ndarray) -> np.ndarray:
        block = operator[3:6]
        return block @ np.linalg.solve(block, press)

    return _median_us(solve, np.broadcast_to([1e-4, 0.0, -DEPTH], (SOLVES, 3)))


def _median_us(work: Callable[[np.ndarray], object], inputs: np.ndarray) -> float:
    times = []
    for each in inputs:
        started = time.perf_counter_ns()
        work(each)
        times.append(time.perf_counter_ns() - started)
    return 1e-3 * float(np.median(times))
