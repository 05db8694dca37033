"""A sphere in a groove: it touches both walls at once, and slides across the bottom from one to the other.

The groove has a right angle and runs along y through the middle of a block's top. The direct solution has one half of
the sphere on one wall of a quarter of the block: a flat contact problem, with gap and compliance taken along the
wall's normal.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.body import Body
from palpate.green import GreensFunction
from palpate.mesh import TetMesh
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import Check, Outcome, green_of, quiet_body
from palpate.validation.verify.contact import measures, tools
from palpate.validation.verify.contact.loop import loop_of, sphere, straight
from palpate.validation.verify.contact.paths import ClosedPaths
from palpate.validation.verify.contact.reference import SOFT, graded
from palpate.validation.verify.contact.signorini import ContactProblem, compliance_along, faces_on
from palpate.validation.verify.grids import lattice, mapped

# Widths and height of the block, and the depth of its groove, m.
SIZE, DEEP = (0.1, 0.1, 0.05), 0.02
RADIUS, SPACING = 0.01, 0.005
# How far the sphere is pressed down from where it touches both walls, m; reach of the touchable wall beside the foot
# and the edge of the elements there, m.
DEPTHS, REACH, CELL = (1e-3, 2e-3), 5e-3, 0.7e-3
# Height of the sphere's middle where it touches both walls, m.
TOUCHES = SIZE[2] - DEEP + np.sqrt(2) * RADIUS
DOWN = np.array([0.0, 0.0, -1.0])
DIRECT, SMOOTH, PASSIVE = "direct contact solve", "a smooth law", "passivity"


def groove() -> Outcome:
    """Press into the groove, sweep across and along it, and go round closed paths."""
    simulation = grooved_loop()
    checks = []
    for depth, direct in zip(DEPTHS, direct_forces(DEPTHS), strict=True):
        force = pressed(simulation, depth)
        checks.append(Check(f"force, {1e3 * depth:g} mm deep", 1e3 * force[2], 1e3 * direct, DIRECT, 0.07, "mN"))
        checks.append(Check(f"part of it across, {1e3 * depth:g} mm deep", abs(force[0]) / force[2], 0.0, DIRECT, 0.02))
    for name, forces in sweeps(simulation).items():
        checks.append(Check(f"{name}: largest jump over the allowed", measures.largest_jump(forces), 0.0, SMOOTH, 1.0))
    for friction in (0.0, 0.3):
        leak = max(given_out(grooved_loop(friction), 40), 0.0)
        checks.append(Check(f"friction {friction:g}: most given out over the peak", leak, 0.0, PASSIVE, 1e-3))
    return Outcome(checks)


def grooved(quarter: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None) -> TetMesh:
    """Block with its groove; or a part of it, by coordinates along x, y and, from 0 to 1, the height."""
    if quarter is None:
        count = [round(side / (2 * SPACING)) for side in SIZE]
        x, y = (np.linspace(-side / 2, side / 2, n + 1) for side, n in zip(SIZE[:2], count[:2], strict=True))
        quarter = (x, y, np.linspace(0, 1, count[2] + 1))

    def place(at: np.ndarray) -> np.ndarray:
        top = SIZE[2] - np.maximum(DEEP - np.abs(at[:, 0]), 0.0)
        return np.column_stack([at[:, 0], at[:, 1], at[:, 2] * top])

    return mapped(lattice(*quarter), place, quadratic=True)


def grooved_body() -> Body:
    """Return the block on its table."""
    mesh = grooved()
    return quiet_body(mesh, SOFT, mesh.nodes[:, 2] < 1e-9)


def grooved_loop(friction: float = 0.0) -> Simulation:
    """Force loop of the block with a sphere; the walls may be touched."""
    body = grooved_body()
    return loop_of(body, walls(body), [sphere(RADIUS, friction)])


def walls(body: Body) -> GreensFunction:
    """Return the Green's function with the walls of the groove, and 10 mm beside it, touchable."""
    surface = body.mesh.surface_nodes
    x, y, z = body.mesh.nodes[surface].T
    near = (np.abs(x) < DEEP + 0.011) & (np.abs(y) < 0.031) & (z > SIZE[2] - 1.01 * DEEP)
    return green_of(body, touch=surface[near])


def pressed(simulation: Simulation, depth: float) -> np.ndarray:
    """Force (3,), N, on a device that goes straight down."""
    above = np.array([0.0, 0.0, TOUCHES])
    return simulation.run(straight(above - 5e-4 * DOWN, above + depth * DOWN, 2e-5))[-1]


def sweeps(simulation: Simulation, length: float = 4e-3, step: float = 1e-6) -> dict[str, np.ndarray]:
    """Return forces (n, 3), N, of sweeps by the micrometre: over from wall to wall, along the bottom, and down."""
    pressed_in = np.array([0.0, 1e-3, TOUCHES]) + 1.5e-3 * DOWN
    across = straight(pressed_in - (length / 2, 0, 0), pressed_in + (length / 2, 0, 0), step)
    # On a wall it is as deep as where it touches both.
    across[:, 2] += np.abs(across[:, 0])
    paths = {
        "across the bottom": across,
        "along the bottom": straight(pressed_in, pressed_in + (3e-4, length, 0), step),
        "pressing": straight(pressed_in - 2e-3 * DOWN, pressed_in + 1e-3 * DOWN + (2e-4, 0, 0), step),
    }
    found = {}
    for name, path in paths.items():
        lead = path[0] + np.linspace(4e-3, 0, 80, endpoint=False)[:, None] * -DOWN
        found[name] = simulation.run(np.vstack([lead, path]))[len(lead) :]
    return found


def given_out(simulation: Simulation, paths: int) -> float:
    """Most that a closed path in the groove gives out, over its peak."""
    centre = np.array([[0.0, 0.0, TOUCHES - RADIUS]])
    closed = ClosedPaths.over(centre, RADIUS, paths=paths, ticks=600, slide=5e-3, depth=(1e-3, 3e-3))
    positions, orientations = closed.script()
    played = simulation.play(positions[:, 0], orientations[:, 0])
    forces, torques = (closed.of_script(rows[:, None]) for rows in (played.forces, played.torques))
    return measures.leak(*measures.given_out(closed.positions, forces, closed.orientations, torques))


def direct_forces(depths: Sequence[float]) -> list[float]:
    """Vertical forces, N, by the linear complementarity problem on one wall of a quarter of the block."""
    foot = RADIUS / np.sqrt(2)
    x, y = graded(0, SIZE[0] / 2, foot, REACH, CELL), graded(0, SIZE[1] / 2, 0, REACH, CELL)
    x[np.abs(x - DEEP).argmin()] = DEEP
    mesh = grooved((x, y, graded(0, 1, 1, 0.08, 0.018)))
    fixed = np.zeros(mesh.nodes.shape, dtype=bool)
    fixed[:, :2] = np.abs(mesh.nodes[:, :2]) < 1e-9
    fixed[mesh.nodes[:, 2] < 1e-9] = True
    bottom, up = np.array([0.0, 0.0, SIZE[2] - DEEP]), np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    normal = np.array([-1.0, 0.0, 1.0]) / np.sqrt(2)
    offset = mesh.nodes - bottom
    on_wall = (np.abs(offset @ normal) < 1e-9) & (mesh.nodes[:, 0] > 1e-9)
    near = (np.abs(offset @ up - RADIUS) < REACH) & (mesh.nodes[:, 1] < REACH)
    green = green_of(
        quiet_body(mesh, SOFT, fixed), touch=np.intersect1d(np.flatnonzero(on_wall & near), mesh.surface_nodes)
    )
    faces = faces_on(green, mesh, bottom, normal)
    plane = np.column_stack([offset @ up, mesh.nodes[:, 1]])
    problem = ContactProblem.on(faces, plane, lambda nodes: compliance_along(green, nodes, normal))
    found = []
    for depth in depths:
        # Going down, the sphere goes into the wall and along it.
        into = depth / np.sqrt(2)
        gap = tools.sphere(RADIUS, (RADIUS - into, 0.0))
        # Four quarters, each with half of the force of a wall.
        found.append(4 * problem.press(gap, [into])[0].force / np.sqrt(2))
    return found
