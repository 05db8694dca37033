"""The half-space pressed by a point force, a uniform pressure on a disc, and a rigid flat punch.

A quarter of a half-space inside a hemisphere; the exact displacement is imposed on the hemisphere, for a rim that is
simply fixed would have to lie some thirty disc radii away. The mesh follows oblate spheroidal coordinates,

    r = a cosh s cos t,    z = a sinh s sin t,

in which the disc of radius a is the face s = 0: elements shrink towards its edge, where the pressure under a punch has
no bound, as the square of their number.

Exact displacements are sums of Boussinesq's for point forces (K. L. Johnson, Contact Mechanics, 1985, chapter 3), z
pointing into the body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.body import Body, Loads, Material
from palpate.mesh import TetMesh
from palpate.validation.verify.benchmark import Check, Outcome, at_node, green_of, surface_response, with_moved_supports
from palpate.validation.verify.grids import cylindrical, lattice, mapped

SOFT = Material(10e3, 0.45)
RADIUS = 0.01
CELLS = (8, 8, 6)  # outwards, from the rim of the disc to its centre, around the quarter
REACH = 6.0  # radius of the hemisphere over that of the disc
TOTAL = 1.0  # N on the whole disc
JOHNSON = "Johnson 1985, chapter 3"


def point_force() -> Outcome:
    """Under a point force the surface sinks by `(1 - nu^2) P / (pi E r)`."""
    mesh, fixed = _quarter_mesh()
    loads = Loads(forces={int(np.linalg.norm(mesh.nodes, axis=1).argmin()): (0, 0, TOTAL / 4)})
    u = _response(mesh, fixed, loads, np.zeros((1, 3)), np.array([TOTAL]))
    x = mesh.nodes[mesh.surface_nodes]
    r = np.linalg.norm(x, axis=1)
    largest_cell = RADIUS * np.sin(np.pi / 2 / CELLS[1])
    seen = (x[:, 2] < 1e-9) & (r > 3 * largest_cell)
    exact = (1 - SOFT.poissons_ratio**2) * TOTAL / (np.pi * SOFT.youngs_modulus * r[seen])
    off = float(np.abs(u[seen, 2] / exact - 1).max())
    return Outcome([Check("surface from 3 elements off, largest error", off, 0.0, "Boussinesq", 0.05)])


def pressed_disc() -> Outcome:
    """Under a uniform pressure the centre sinks by `2 (1 - nu^2) p a / E`, the rim by 2 / pi of it."""
    mesh, fixed = _quarter_mesh()
    pressure = TOTAL / (np.pi * RADIUS**2)
    at, share = _sources(lambda v: 2 * np.sin(v) * np.cos(v))
    loads = Loads(pressure=[(_on_disc(mesh), pressure)])
    u = _response(mesh, fixed, loads, at, share * TOTAL)
    centre = 2e3 * (1 - SOFT.poissons_ratio**2) * pressure * RADIUS / SOFT.youngs_modulus
    checks = []
    for name, x, target in (("centre", 0.0, centre), ("rim", RADIUS, centre * 2 / np.pi)):
        computed = 1e3 * float(u[at_node(mesh, (x, 0, 0)), 2])
        checks.append(Check(f"{name} of the disc", computed, target, JOHNSON, 0.03, "mm"))
    return Outcome(checks)


def flat_punch() -> Outcome:
    """Under a rigid flat punch without friction, `P = 2 a E d / (1 - nu^2)`."""
    mesh, fixed = _quarter_mesh()
    depth = 1e-4
    target = 2 * RADIUS * SOFT.youngs_modulus / (1 - SOFT.poissons_ratio**2)
    at, share = _sources(np.sin)  # p = P / (2 pi a sqrt(a^2 - r^2))
    body = with_moved_supports(Body(mesh, material=SOFT, fixed=fixed), _exact(mesh.nodes, at, share * target * depth))
    disc = np.flatnonzero(_on_disc(mesh))
    green = green_of(body, touch=disc)
    answer = green.solve(displacements={int(node): (None, None, depth) for node in disc})
    force = 4 * float(answer.forces[np.searchsorted(green.surface_nodes, disc), 2].sum())
    return Outcome([Check("stiffness", force / depth, target, JOHNSON, 0.05, "N/m")])


def _quarter_mesh() -> tuple[TetMesh, np.ndarray]:
    """Mesh of 10-node tetrahedra, and its supports: rollers on the planes of symmetry, all of the hemisphere."""
    outwards, inwards, around = CELLS
    s = np.linspace(0, np.arcsinh(REACH), outwards + 1)
    t = np.linspace(0, np.pi / 2, inwards + 1)
    angle = np.linspace(0, np.pi / 2, around + 1)
    s, t, angle = np.moveaxis(lattice(s, t, angle), -1, 0)
    cos_t = np.where(t < np.pi / 2, np.cos(t), 0.0)
    coordinates = np.stack([RADIUS * np.cosh(s) * cos_t, angle, RADIUS * np.sinh(s) * np.sin(t)], axis=-1)
    mesh = mapped(coordinates, cylindrical, quadratic=True)
    fixed = np.abs(mesh.nodes) < 1e-9 * RADIUS
    fixed[:, 2] = False
    fixed[_on_rim(mesh)] = True
    return mesh, fixed


def _on_disc(mesh: TetMesh) -> np.ndarray:
    r, z = np.linalg.norm(mesh.nodes[:, :2], axis=1), mesh.nodes[:, 2]
    return (np.abs(z) < 1e-9 * RADIUS) & (r < RADIUS * (1 + 1e-9))


def _on_rim(mesh: TetMesh) -> np.ndarray:
    """Nodes of the faces that close the quarter off: neither on its surface nor on a plane of symmetry."""
    corners = mesh.nodes[mesh.surface_faces[:, :3]]
    flat = (np.abs(corners) < 1e-9 * RADIUS).all(axis=1).any(axis=1)
    rim = np.zeros(len(mesh.nodes), dtype=bool)
    rim[mesh.surface_faces[~flat]] = True
    return rim


def _sources(density: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Stand for a load on the disc by points (n, 3) with shares (n,) of its total, good outside the disc.

    With `r = a sin v`, the part of the load between `v` and `v + dv` is `density(v) dv`.
    """
    points, weights = np.polynomial.legendre.leggauss(12)
    v, weights = np.pi / 4 * (1 + points), np.pi / 4 * weights
    angle = 2 * np.pi * np.arange(24) / 24
    r = RADIUS * np.sin(v)[:, None]
    at = np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r * angle], axis=-1).reshape(-1, 3)
    return at, np.repeat(weights * density(v), len(angle)) / len(angle)


def _exact(x: np.ndarray, at: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Boussinesq's displacements (n, 3), m, by normal forces, N, at points of the surface; zero at those points."""
    shear = SOFT.youngs_modulus / (2 * (1 + SOFT.poissons_ratio))
    u = np.zeros_like(x)
    for source, force in zip(at, forces, strict=True):
        offset = x - source
        distance = np.linalg.norm(offset, axis=1)
        distance[distance == 0] = np.inf
        z = offset[:, 2]
        along = z / distance**3 - (1 - 2 * SOFT.poissons_ratio) / (distance * (distance + z))
        down = z**2 / distance**3 + 2 * (1 - SOFT.poissons_ratio) / distance
        u += force / (4 * np.pi * shear) * np.column_stack([along * offset[:, 0], along * offset[:, 1], down])
    return u


def _response(mesh: TetMesh, fixed: np.ndarray, loads: Loads, at: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Displacements of the surface (s, 3), m, under loads on the disc, with the exact ones on the rim."""
    motion = _exact(mesh.nodes, at, forces)
    body = with_moved_supports(Body(mesh, material=SOFT, fixed=fixed, loads=loads), motion)
    return surface_response(body) + np.where(fixed, motion, 0.0)[mesh.surface_nodes]
