"""A block with one edge, sharp or round, or a blade, and the contact of a rigid tool there solved directly.

The tool keeps its shape and the body is linear, so the contact is the minimum of the body's energy with no point of its
surface inside the tool. `phi` is the tool's signed distance, `n` its gradient. Near displacements `u_k`

    phi(x + u) = phi(x + u_k) + n . (u - u_k),

so that with pressures `p = sum_j p_j h_j`, h_j the linear hat of a node, and `M_icj = int N_i h_j n_c dA`

    A = M^T Psi M,    w = A p + int h (phi - n . u_k) dA >= 0,    p >= 0,    p . w = 0,

a linear complementarity problem (`palpate.validation.verify.contact.signorini` has the case of a plane), solved again
with the new `u` until the force does not change. No normal of the body is used: a sharp edge needs none. Nothing of the
force loop is used either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

import palpate
from palpate.body import Body, Material
from palpate.green import GreensFunction
from palpate.mesh import TetMesh
from palpate.mesh.elements import FACE_TRIANGLES
from palpate.mesh.files import FROM_NETGEN
from palpate.mesh.shape_functions import TRIANGLE_NODES
from palpate.scene import BuiltScene
from palpate.validation.verify.benchmark import green_of, quiet_body
from palpate.validation.verify.contact.loop import UNLIMITED

SOFT = Material(10e3, 0.45)
PLANE_MODULUS = 10e3 / (1 - 0.45**2)
# The block reaches from the edge at x = z = 0 so far towards -x and -z, and half as long along the edge, m.
WIDTH, HALF_LENGTH = 0.05, 0.03
MILLIMETRE = 1e-3
# Steps in which the force loop's tool comes to its depth, m.
STEP = 10e-6
# The distance of points outside of a tool, m, and its gradient, both in the tool's frame.
Distance = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def capsule(radius: float, length: float) -> Distance:
    """Around the segment from the origin to ``length`` along z."""

    def distance(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = points - np.clip(points[:, 2], 0.0, length)[:, None] * [0.0, 0.0, 1.0]
        size = np.linalg.norm(off, axis=1)
        return size - radius, off / np.maximum(size, 1e-12)[:, None]

    return distance


def punch(radius: float, rounding: float) -> Distance:
    """Cylinder from z = 0 to four radii, its rims rounded."""

    def distance(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        out = np.hypot(points[:, 0], points[:, 1])
        side = points[:, :2] / np.maximum(out, 1e-12)[:, None]
        height = points[:, 2] - 2 * radius
        over = np.column_stack([out - (radius - rounding), np.abs(height) - (2 * radius - rounding)])
        beyond = np.maximum(over, 0.0)
        size = np.linalg.norm(beyond, axis=1)
        # Inside of the core the nearer of side and face counts.
        core = np.where(over[:, :1] > over[:, 1:], [1.0, 0.0], [0.0, 1.0])
        away = np.where(size[:, None] > 0, beyond / np.maximum(size, 1e-12)[:, None], core)
        gradient = np.column_stack([away[:, :1] * side, away[:, 1] * np.sign(height)])
        return np.where(size > 0, size, over.max(axis=1)) - rounding, gradient

    return distance


def sphere(radius: float) -> Distance:
    """Around the origin."""
    return capsule(radius, 0.0)


@dataclass(frozen=True)
class Region:
    """Part of a half block that is meshed finely: how far from the edge over the top and down the side, along it, m."""

    over: float
    down: float
    along: float
    element: float


def half_block(rounding: float, region: Region) -> TetMesh:
    """The half y > 0 of the block, of curved 10-node tetrahedra, small near the middle of the edge."""
    from netgen.occ import Box, Glue, Pnt

    far, end = WIDTH / MILLIMETRE, region.along / MILLIMETRE
    block = _rounded(Box(Pnt(-far, 0, -far), Pnt(0, HALF_LENGTH / MILLIMETRE, 0)), rounding)
    fine = block * Box(Pnt(-region.over / MILLIMETRE, -1, -region.down / MILLIMETRE), Pnt(1, end, 1))
    fine.maxh = region.element / MILLIMETRE
    return _meshed(Glue([fine, block - fine]), coarsest=12.0)


def whole_block(rounding: float, element: float) -> TetMesh:
    """The block as the force loop has it: elements of one size, m."""
    from netgen.occ import Box, Pnt

    far, long = WIDTH / MILLIMETRE, HALF_LENGTH / MILLIMETRE
    return _meshed(_rounded(Box(Pnt(-far, -long, -far), Pnt(0, long, 0)), rounding), element / MILLIMETRE)


def _rounded(block, rounding: float):
    if rounding == 0:
        return block
    edges = [edge for edge in block.edges if abs(edge.center.x) + abs(edge.center.z) < 1e-6]
    return block.MakeFillet(edges[:1], rounding / MILLIMETRE)


def _meshed(shape, coarsest: float) -> TetMesh:
    from netgen.occ import OCCGeometry

    mesh = OCCGeometry(shape).GenerateMesh(maxh=coarsest, grading=0.4)
    mesh.SecondOrder()
    points = MILLIMETRE * np.array([point.p for point in mesh.Points()])
    tets = np.array([[point.nr - 1 for point in element.points] for element in mesh.Elements3D()])
    return TetMesh(points, tets[:, FROM_NETGEN[10]])


@dataclass(frozen=True)
class Placed:
    """A tool at first touch: its table, its shape, how it is turned, and its origin, m."""

    tool: dict[str, Any]
    shape: Distance
    rotation: Rotation
    start: np.ndarray


def loop_forces(built: tuple[Body, GreensFunction], placed: Placed, way: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """Forces (n, 3), N, of the loop on a tool without friction that is pressed against ``way`` to depths (n,), m."""
    tool = {**placed.tool, "friction": 0.0}
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=tool, device=UNLIMITED, view={"strain_limit": 0})
    down = np.arange(-1e-3, depths[-1] + STEP / 2, STEP)
    path = placed.start - down[:, None] * way
    turned = np.tile(np.roll(placed.rotation.as_quat(), 1), (len(path), 1))
    forces = palpate.Simulation(BuiltScene.of(scene, *built)).play(path, turned).computed_forces
    return forces[np.searchsorted(down, depths - STEP / 2)]


def within(forces: np.ndarray, expected: np.ndarray, tolerance: float) -> np.ndarray:
    return np.abs(forces / expected - 1) <= tolerance


def outward(degrees: float) -> np.ndarray:
    """Unit vector from the edge away from the body, along the bisector of its angle."""
    half = np.radians(degrees / 2)
    return np.array([np.cos(half), 0.0, np.sin(half)])


def body_of(mesh: TetMesh, half: bool, degrees: float = 90.0) -> Body:
    """The block sheared to an edge of so many degrees, held at the two faces away from it.

    A half keeps its plane of symmetry.
    """
    x, y, z = mesh.nodes.T
    fixed = np.zeros(mesh.nodes.shape, dtype=bool)
    fixed[(x < -WIDTH + 1e-9) | (z < -WIDTH + 1e-9)] = True
    if half:
        fixed[np.abs(y) < 1e-9, 1] = True
    return quiet_body(_sheared(mesh, degrees), SOFT, fixed)


def _sheared(mesh: TetMesh, degrees: float) -> TetMesh:
    x, y, z = mesh.nodes.T
    return TetMesh(np.column_stack([x + z / np.tan(np.radians(degrees)), y, z]), mesh.tets)


@cache
def direct_contact(rounding: float, region: Region, degrees: float = 90.0) -> DirectContact:
    """Make the contact problem of an edge once for all tools."""
    return DirectContact(half_block(rounding, region), region, degrees)


class DirectContact:
    """Compliance of the fine part of a half block's surface, and its presses."""

    def __init__(self, mesh: TetMesh, region: Region, degrees: float = 90.0):
        faces = _near_faces(mesh, region)
        self._nodes, local = np.unique(faces, return_inverse=True)
        self._faces = local.reshape(faces.shape)
        body = body_of(mesh, half=True, degrees=degrees)
        green = green_of(body, touch=self._nodes)
        self._places = body.mesh.nodes[self._nodes]
        self._compliance = compliance_between(green, self._nodes)
        self._shapes, self._hats, self._areas = self._quadrature()

    def press(self, tool: Distance, places: np.ndarray, rotation: Rotation, rounds: int = 30) -> np.ndarray:
        """Forces (n, 3), N, on a tool whose origin goes through places (n, 3), m; each begins from the one before."""
        moved, found = np.zeros_like(self._places), []
        for place in places:
            size = np.inf
            for step in range(rounds):
                before = size
                # Half of each step, for at a sharp edge the tool's normals swing to and fro. What is left after a few
                # rounds is the edge's slow way aside, of which the force knows nothing.
                after, force = self._settle(tool, place, rotation, moved)
                moved = moved + (1.0 if step == 0 else 0.5) * (after - moved)
                size = float(np.linalg.norm(force))
                if abs(size - before) <= 1e-3 * size:
                    break
            else:
                raise AssertionError(f"the direct solution does not settle: {before} and {size} N")
            # Both halves.
            found.append(force * [2.0, 0.0, 2.0])
        return np.array(found)

    def _settle(
        self, tool: Distance, place: np.ndarray, rotation: Rotation, moved: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        at = self._shapes @ (self._places + moved)
        distance, normal = tool(rotation.inv().apply(at - place))
        normal = rotation.apply(normal)
        weighted = self._hats.T.multiply(self._areas).tocsr()
        # Far from the tool no pressure acts.
        near = np.flatnonzero(weighted @ (distance < 1.5e-3))
        weighted = weighted[near]
        load = np.concatenate(
            [(self._shapes.T @ scipy.sparse.diags(normal[:, c]) @ weighted.T).toarray() for c in range(3)]
        )
        compliance = load.T @ (self._compliance @ load)
        gap = weighted @ (distance - np.einsum("qc,qc->q", normal, self._shapes @ moved))
        scale = 1 / np.sqrt(np.diag(compliance))
        factor = scipy.linalg.cholesky(scale[:, None] * compliance * scale + 1e-12 * np.eye(len(near)), lower=True)
        right = scipy.linalg.solve_triangular(factor, -scale * gap, lower=True)
        pressures = scale * nnls(factor.T, right, maxiter=20 * len(near))[0]
        forces = (load @ pressures).reshape(3, -1)
        return (self._compliance @ forces.ravel()).reshape(3, -1).T, -forces.sum(axis=1)

    def _quadrature(self) -> tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix, np.ndarray]:
        """Shape functions (q, n), hats (q, n) and areas (q,) at the points of the curved faces' four parts."""
        at, weight = _six_points()
        rows, places = len(self._faces), self._places[self._faces]
        shapes, hats, areas = [], [], []
        for part in FACE_TRIANGLES[6]:
            corners = TRIANGLE_NODES[part]
            for barycentric, hat, share in zip(at @ corners, at, weight, strict=True):
                values, slopes = _shape_functions(barycentric)
                tangents = np.einsum("sa,fac->fsc", slopes, places)
                area = np.linalg.norm(np.cross(tangents[:, 0], tangents[:, 1]), axis=1) / 2
                shapes.append(_rows(np.tile(values, (rows, 1)), self._faces, len(self._nodes)))
                hats.append(_rows(np.tile(hat, (rows, 1)), self._faces[:, part], len(self._nodes)))
                areas.append(area * share / len(FACE_TRIANGLES[6]))
        return scipy.sparse.vstack(shapes).tocsr(), scipy.sparse.vstack(hats).tocsr(), np.concatenate(areas)


def _near_faces(mesh: TetMesh, region: Region) -> np.ndarray:
    """Faces of the top, of the side and of the round between them in the fine part."""
    faces = mesh.surface_faces
    middle = mesh.nodes[faces[:, :3]].mean(axis=1)
    x, y, z = middle.T
    own = (x > -region.over) & (z > -region.down) & (y < region.along) & (y > 1e-6)
    # Not those of the plane of symmetry.
    return faces[own & (np.ptp(mesh.nodes[faces[:, :3], 1], axis=1) > 1e-9)]


def compliance_between(green: GreensFunction, nodes: np.ndarray) -> np.ndarray:
    """`Psi` (3n, 3n) between nodes, m/N, axis by axis."""
    rows, columns = (np.searchsorted(some, nodes) for some in (green.surface_nodes, green.touchable_nodes))
    entry, n = green._core.entry, 3 * len(nodes)
    rows, columns = ((3 * some[None] + np.arange(3)[:, None]).ravel() for some in (rows, columns))
    psi = np.zeros((n, n))
    for i, row in enumerate(rows.tolist()):
        psi[i, : i + 1] = [entry(row, column) for column in columns[: i + 1].tolist()]
    return psi + np.tril(psi, -1).T


def _rows(values: np.ndarray, columns: np.ndarray, width: int) -> scipy.sparse.csr_matrix:
    start = np.arange(len(values) + 1) * values.shape[1]
    return scipy.sparse.csr_matrix((values.ravel(), columns.ravel(), start), (len(values), width))


def _shape_functions(barycentric: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Six shape functions, and their derivatives (2, 6) along the first two coordinates, at one point."""
    a, b, c = barycentric
    values = np.array([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a])
    by_a = np.array([4 * a - 1, 0, 1 - 4 * c, 4 * b, -4 * b, 4 * (c - a)])
    by_b = np.array([0, 4 * b - 1, 1 - 4 * c, 4 * a, 4 * (c - b), -4 * a])
    return values, np.stack([by_a, by_b])


def _six_points() -> tuple[np.ndarray, np.ndarray]:
    """Six points of degree four on a triangle (Dunavant 1985): barycentric coordinates and parts of the area."""
    points, weights = [], []
    for a, w in ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)):
        points += [np.roll([1 - 2 * a, a, a], k) for k in range(3)]
        weights += 3 * [w]
    return np.array(points), np.array(weights)
