"""Stiffness felt on a block: of a patch of fixed radius, which converges, and of a single node, which does not."""

from __future__ import annotations

from functools import partial

import numpy as np

from palpate.body import Body, Material
from palpate.green import GreensFunction
from palpate.mesh import TetMesh
from palpate.validation.plots import plot_felt_stiffness
from palpate.validation.verify.benchmark import Check, Outcome, green_of, quiet_body
from palpate.validation.verify.exactness import ORDER_NAMES
from palpate.validation.verify.grids import box, lattice, mapped

# A cube glued to a table, pressed in the middle of its top by a patch of a quarter of its width, nothing fixing it
# sideways.
WIDTH, RADIUS, YOUNGS_MODULUS, NU = 0.06, 0.015, 10e3, 0.45
TOP = (WIDTH / 2, WIDTH / 2, WIDTH)
PRESS = 1e-3
CELLS = {False: (8, 12, 16, 24), True: (4, 6, 8, 12)}


def felt_stiffness() -> Outcome:
    """Felt stiffness on ever finer meshes; both elements have the same nodes on each."""
    limit = reference_stiffness(NU)
    checks, series = [], {}
    for quadratic, counts in CELLS.items():
        name, tolerance = ORDER_NAMES[quadratic], 0.03 if quadratic else None
        patch, node = np.array([_patch_and_node(count, quadratic) for count in counts]).T
        series[name] = (np.array(counts) * (2 if quadratic else 1), patch, node)
        change, lost = abs(patch[-1] / patch[-2] - 1), node[-1] / node[0]
        first, last = counts[0], counts[-1]
        steps = f"{counts[-2]} to {last} cells"
        checks += [
            Check(f"{name}: change of a patch, {steps}", change, 0.0, "convergence", tolerance),
            Check(f"{name}: patch, {last} cells", patch[-1], limit, "graded mesh", tolerance, "N/m"),
            Check(f"{name}: one node, {last} over {first} cells", lost, first / last, "one node: E h", None),
        ]
    return Outcome(checks, {"felt-stiffness.png": partial(plot_felt_stiffness, series, limit)})


def block(cells: int, quadratic: bool, nu: float) -> Body:
    """Return the cube with equal cells."""
    mesh = box((cells,) * 3, (WIDTH,) * 3, quadratic=quadratic)
    return quiet_body(mesh, Material(YOUNGS_MODULUS, nu), mesh.nodes[:, 2] < 1e-9)


def stiffness(green: GreensFunction, point: tuple[float, ...] = TOP, radius: float = RADIUS) -> float:
    """Force over depth, N/m, pressing straight down and free to move sideways."""
    return -float(green.touch(point, (None, None, -PRESS), radius).force[2]) / PRESS


def around(mesh: TetMesh, point: tuple[float, ...]) -> np.ndarray:
    """Surface nodes of all faces that a patch may reach."""
    reach = np.linalg.norm(mesh.nodes[mesh.surface_faces] - point, axis=2).min(axis=1)
    edge = np.linalg.norm(np.diff(mesh.nodes[mesh.surface_faces[:, :2]], axis=1), axis=2).max()
    return np.unique(mesh.surface_faces[reach < RADIUS + edge])


def reference_stiffness(nu: float) -> float:
    """Converged value, to 0.2 %: a quarter of the cube by symmetry, ever finer towards the patch."""
    side = WIDTH / 2 * np.linspace(0, 1, 9) ** 1.5
    up = WIDTH * (1 - (1 - np.linspace(0, 1, 13)) ** 1.5)
    mesh = mapped(lattice(side, side, up), quadratic=True)
    fixed = np.abs(mesh.nodes) < 1e-9
    fixed[fixed[:, 2]] = True
    body = quiet_body(mesh, Material(YOUNGS_MODULUS, nu), fixed)
    # The top and the planes of symmetry meet at the point: a micrometre aside it lies on the top alone.
    point = (1e-6, 1e-6, WIDTH)
    return 4 * stiffness(green_of(body, touch=around(mesh, point)), point)


def _patch_and_node(cells: int, quadratic: bool) -> tuple[float, float]:
    body = block(cells, quadratic, NU)
    green = green_of(body, touch=around(body.mesh, TOP))
    return stiffness(green), stiffness(green, radius=0.0)
