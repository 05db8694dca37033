"""Bodies on which contacts went wrong: edges of any angle, a torus, a cup, a prism with a star's section; all small.

Structured, so that no mesher is needed. Edges and creases run along y through the origin.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

import palpate
from palpate.mesh import TetMesh
from palpate.validation.verify.benchmark import quiet_body
from palpate.validation.verify.grids import box, lattice, mapped

MATERIAL = palpate.Material(10e3, 0.45, 1000.0)
# A torus: radii of circle and tube; a cup: radius, height, wall; a star: points, radii, length, m.
TORUS = (0.04, 0.01)
CUP = (0.035, 0.07, 0.004)
STAR = (5, 0.04, 0.02, 0.06)
# Length of an edge, and thickness of the bodies beside it, m.
EDGE_LENGTH, THICK = 0.06, 0.03


def convex(degrees: float, tilt: float = 0.0) -> palpate.Body:
    """A sheared box with a level top and an edge of so many degrees; turned about the edge by ``tilt``, rad."""
    mesh = box((6, 6, 4), (0.05, EDGE_LENGTH, THICK), quadratic=True)
    x, y, z = mesh.nodes.T
    x, z = x - 0.05, z - THICK
    moved = np.column_stack([x - z * -np.cos(np.radians(degrees)) / np.sin(np.radians(degrees)), y, z])
    return _held(TetMesh(_tilted(moved, tilt), mesh.tets), z < -THICK + 1e-9)


def concave(degrees: float, tilt: float = 0.0) -> palpate.Body:
    """A level floor, x < 0, and a wall that rises from it, with so many degrees of air between; turned by ``tilt``.

    Both are longer than a tool 24 mm long that lies across them reaches.
    """
    reach = 0.016 / np.sin(np.radians(degrees / 2))
    floor, wall = max(0.045, reach), max(0.02, reach * np.sin(np.radians(degrees)))
    across = np.concatenate([np.linspace(-floor, 0, round(floor / 0.009) + 1), np.linspace(0, 0.03, 5)[1:]])
    up = np.concatenate([np.linspace(-THICK, 0, 4), np.linspace(0, wall, round(wall / 0.007) + 1)[1:]])
    mesh = mapped(lattice(across, np.linspace(0, EDGE_LENGTH, 7), up), quadratic=True)
    centres = mesh.nodes[mesh.tets[:, :4]].mean(axis=1)
    tets = mesh.tets[~((centres[:, 0] < 0) & (centres[:, 2] > 0))]
    used, tets = np.unique(tets, return_inverse=True)
    x, y, z = mesh.nodes[used].T
    leaned = np.column_stack([x - np.maximum(z, 0) / np.tan(np.radians(degrees)), y, z])
    return _held(TetMesh(_tilted(leaned, tilt), tets.reshape(-1, 10)), z < -THICK + 1e-9)


def ridge(degrees: float) -> palpate.Body:
    """A convex edge whose bisector is upright."""
    return convex(degrees, np.radians(90 - degrees / 2))


def valley(degrees: float) -> palpate.Body:
    """A concave edge whose bisector is upright."""
    return concave(degrees, np.radians(degrees / 2 - 90))


def _tilted(nodes: np.ndarray, angle: float) -> np.ndarray:
    return Rotation.from_rotvec([0.0, -angle, 0.0]).apply(nodes)


def torus() -> palpate.Body:
    radius, tube = TORUS

    def place(coordinates: np.ndarray) -> np.ndarray:
        r, around, along = coordinates.T
        out = radius + r * np.cos(around)
        return np.column_stack([out * np.cos(along), out * np.sin(along), r * np.sin(around)])

    rings = lattice(np.linspace(0, tube, 3), *(2 * np.pi * np.linspace(0, 1, count + 1) for count in (10, 24)))

    def curved(middle: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        def to_tube(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            out, z = np.hypot(points[:, 0], points[:, 1]) - radius, points[:, 2]
            return np.hypot(out, z), np.arctan2(z, out)

        r = 0.5 * (to_tube(first)[0] + to_tube(second)[0])
        return place(np.column_stack([r, to_tube(middle)[1], np.arctan2(middle[:, 1], middle[:, 0])]))

    mesh = _curved(mapped(rings, place, quadratic=False), curved)
    return _held(mesh, mesh.nodes[:, 2] < -0.85 * tube)


def cup() -> palpate.Body:
    """Open above; its floor and its walls are equally thick."""
    radius, height, wall = CUP

    def place(coordinates: np.ndarray) -> np.ndarray:
        # 0 is the axis, 1 the foot of the wall, 2 the rim; outside to inside.
        s, t, angle = coordinates.T
        r = np.minimum(s, 1.0) * (radius - t * wall)
        z = t * wall + np.maximum(s - 1.0, 0.0) * (height - t * wall)
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])

    along = np.concatenate([np.linspace(0, 1, 4), 1 + np.linspace(0, 1, 8)[1:]])

    def curved(middle: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        r = 0.5 * (np.hypot(first[:, 0], first[:, 1]) + np.hypot(second[:, 0], second[:, 1]))
        angle = np.arctan2(middle[:, 1], middle[:, 0])
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), middle[:, 2]])

    flat = mapped(lattice(along, np.array([0.0, 1.0]), 2 * np.pi * np.linspace(0, 1, 19)), place, quadratic=False)
    mesh = _curved(flat, curved)
    return _held(mesh, mesh.nodes[:, 2] < 1e-9)


def star() -> palpate.Body:
    """Upright section, along y, standing on two of its points."""
    points, outer, inner, length = STAR
    corner = np.pi / 2 + np.pi * np.arange(2 * points + 1) / points
    size = np.where(np.arange(2 * points + 1) % 2 == 0, outer, inner)
    corners = size[:, None] * np.column_stack([np.cos(corner), np.sin(corner)])

    def place(coordinates: np.ndarray) -> np.ndarray:
        r, k, y = coordinates.T
        rim = np.column_stack([np.interp(k, np.arange(len(corners)), corners[:, axis]) for axis in (0, 1)])
        x, z = (r[:, None] * rim).T
        return np.column_stack([x, y, z])

    around = np.linspace(0, 2 * points, 4 * points + 1)
    mesh = mapped(lattice(np.linspace(0, 1, 4), around, np.linspace(0, length, 6)), place, quadratic=False)
    mesh = mesh.to_quadratic()
    return _held(mesh, mesh.nodes[:, 2] < mesh.nodes[:, 2].min() + 2e-3)


def block() -> palpate.Body:
    """That of the examples: 80 x 50 x 50 mm, on a table."""
    mesh = box((6, 4, 4), (0.08, 0.05, 0.05), quadratic=True)
    return _held(mesh, mesh.nodes[:, 2] < 1e-9)


def organ(name: str, paper: bool = True) -> palpate.Body:
    """A built-in model, 4-node elements unless it has its full size."""
    mesh = palpate.models.load(name, paper=paper)
    return _held(mesh, palpate.models.fixed(name, mesh))


def _curved(flat: TetMesh, place: Callable[..., np.ndarray]) -> TetMesh:
    """Return 10-node elements; ``place`` moves the middles of edges, given with both ends, onto the curve."""
    mesh = flat.to_quadratic()
    nodes = mesh.nodes.copy()
    for rank, (a, b) in enumerate(((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))):
        middle, first, second = mesh.tets[:, 4 + rank], mesh.tets[:, a], mesh.tets[:, b]
        nodes[middle] = place(mesh.nodes[middle], mesh.nodes[first], mesh.nodes[second])
    return TetMesh(nodes, mesh.tets)


def _held(mesh: TetMesh, fixed: np.ndarray) -> palpate.Body:
    return quiet_body(mesh, MATERIAL, fixed)


BODIES: dict[str, Callable[[], palpate.Body]] = {
    "torus": torus,
    "cup": cup,
    "star": star,
    "block": block,
    **{name: partial(organ, name) for name in ("kidney", "liver", "doll")},
    **{f"{name} in full": partial(organ, name, paper=False) for name in ("kidney", "liver")},
    **{
        f"{kind.__name__} {degrees}": partial(kind, degrees)
        for kind in (convex, concave, ridge, valley)
        for degrees in (30, 60, 90, 120, 150)
    },
}
