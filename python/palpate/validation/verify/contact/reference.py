"""A block pressed by a rigid tool, solved directly on a mesh that is fine under the contact.

The block is that of the acceptance of contact: glued at its bottom, its sides free. Where the tool stands on a plane of
symmetry only one side of it is meshed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from palpate.body import Body, Material
from palpate.mesh import TetMesh
from palpate.validation.verify.benchmark import green_of, quiet_body
from palpate.validation.verify.contact.signorini import ContactProblem, Press
from palpate.validation.verify.contact.tools import Gap, sphere
from palpate.validation.verify.grids import box, lattice, mapped

SOFT = Material(10e3, 0.45)
# Contact radius over the distance of surface nodes under the contact; ratio of neighbouring cells beside it, and of
# those from the fourth on.
RESOLUTION, GROWTH, GROWTH_FAR, NEAR_CELLS = 7.0, 1.6, 2.3, 3


@dataclass(frozen=True)
class Block:
    """A block on a table: widths along x and y, and its height, m."""

    size: tuple[float, float, float] = (0.1, 0.1, 0.05)
    material: Material = SOFT

    @property
    def plane_modulus(self) -> float:
        """`E / (1 - nu^2)`, Pa."""
        return self.material.youngs_modulus / (1 - self.material.poissons_ratio**2)

    def pressed(
        self,
        gap: Gap,
        depths: Sequence[float],
        reach: float,
        cell: float,
        beside: tuple[float, float] = (0.0, 0.0),
        place: tuple[float, float] | None = None,
    ) -> list[Press]:
        """Press a tool; forces are those on all of it.

        Parameters
        ----------
        gap
            Underside over places from the middle of the block, m; of ``place``, from there.
        depths
            m.
        reach
            Half-width of the part of the top that may be touched, m.
        cell
            Edge of the elements there, m; surface nodes lie half as far apart.
        beside
            Moves the fine part away from the middle, within symmetry, m.
        place
            Distances from the sides x = 0 and y = 0, m, of a tool that does not stand in the middle.

        """
        mesh, fixed, parts = self._mesh(reach, cell, beside, place)
        body = quiet_body(mesh, self.material, fixed)
        top = np.abs(mesh.nodes[:, 2]) < 1e-9
        near = (np.abs(mesh.nodes[:, :2] - beside) < reach * (1 + 1e-9)).all(axis=1)
        problem = ContactProblem.on_top(green_of(body, touch=np.flatnonzero(top & near)), mesh)
        return [
            Press(press.depth, parts * press.force, parts * press.area, press.pressures)
            for press in problem.press(gap, depths)
        ]

    def _mesh(
        self, reach: float, cell: float, beside: tuple[float, float], place: tuple[float, float] | None
    ) -> tuple[TetMesh, np.ndarray, int]:
        """Mesh with the tool's place as its origin, what is fixed of it, and how many of it make the block."""
        axes, halves = [], []
        for axis in range(2):
            width = self.size[axis]
            middle = place is None or abs(place[axis] - width / 2) < 1e-12
            low = 0.0 if middle else -place[axis]
            high = width / 2 if middle else width - place[axis]
            axes.append(graded(low, high, beside[axis], reach, cell))
            halves.append(middle)
        down = -graded(0.0, self.size[2], 0.0, reach, cell)[::-1]
        mesh = mapped(lattice(*axes, down), quadratic=True)
        fixed = np.zeros(mesh.nodes.shape, dtype=bool)
        for axis in (axis for axis in range(2) if halves[axis]):
            fixed[:, axis] = np.abs(mesh.nodes[:, axis]) < 1e-9
        fixed[mesh.nodes[:, 2] < -self.size[2] + 1e-9] = True
        return mesh, fixed, 2 ** sum(halves)


def graded(low: float, high: float, centre: float, reach: float, cell: float) -> np.ndarray:
    """Points from ``low`` to ``high``, ``cell`` apart within ``reach`` of ``centre``, ever farther apart outside."""
    first, last = max(low, centre - reach), min(high, centre + reach)
    fine = np.linspace(first, last, max(1, round((last - first) / cell)) + 1)
    return np.concatenate([(first - _growing(first - low, cell))[::-1], fine, last + _growing(high - last, cell)])


def _growing(length: float, cell: float) -> np.ndarray:
    """Return ends of cells that grow by about the ratios above and fill ``length``."""
    if length <= 1e-12:
        return np.zeros(0)
    steps: list[float] = []
    while sum(steps) < length:
        near = len(steps) < NEAR_CELLS
        steps.append((steps[-1] if steps else cell) * (GROWTH if near else GROWTH_FAR))
    ends = np.cumsum(steps)
    return ends * (length / ends[-1])


def cell_under(radius: float, depth: float) -> tuple[float, float]:
    """Half-width of the fine part of the top under a sphere, and edge of its elements, m."""
    contact = np.sqrt(radius * depth)
    cell = 2 * contact / RESOLUTION
    return cell * np.ceil(1.2 * contact / cell), cell


@cache
def sphere_press(block: Block, radius: float, depth: float) -> Press:
    """Press a sphere into the middle of the top."""
    return block.pressed(sphere(radius), [depth], *cell_under(radius, depth))[0]


def body_on_table(block: Block, cells: tuple[int, int, int], *, quadratic: bool) -> Body:
    """Return the block with equal cells, from the origin up, for the force loop."""
    mesh = box(cells, block.size, quadratic=quadratic)
    return quiet_body(mesh, block.material, mesh.nodes[:, 2] < 1e-9)


def finer_in_the_middle(block: Block, cell: float, reach: float, *, quadratic: bool) -> Body:
    """Return the block with cells of one size around the middle of its top, larger ones outside, for the force loop."""
    x, y, z = block.size
    sides = [width / 2 + graded(-width / 2, width / 2, 0.0, reach, cell) for width in (x, y)]
    mesh = mapped(lattice(*sides, z - graded(0.0, z, 0.0, reach, cell)[::-1]), quadratic=quadratic)
    return quiet_body(mesh, block.material, mesh.nodes[:, 2] < 1e-9)


def top_middle(body: Body) -> np.ndarray:
    """Middle of the top, (3,) m."""
    low, high = body.mesh.bounds
    return np.array([*(low + high)[:2] / 2, high[2]])


def top_nodes(body: Body, reach: float = np.inf) -> np.ndarray:
    """Nodes of the top within a distance of its middle along x and y, m."""
    nodes = body.mesh.nodes
    x, y, top = top_middle(body)
    near = (np.abs(nodes[:, :2] - (x, y)) < reach * (1 + 1e-9)).all(axis=1)
    return np.flatnonzero(near & (nodes[:, 2] > top - 1e-9))
