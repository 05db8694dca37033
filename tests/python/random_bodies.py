"""Random bodies by gluing blocks, scaling them and mixing materials; their changes solved directly to more digits."""

from __future__ import annotations

import warnings

import numpy as np
import scipy.sparse.linalg
from conftest import skfem_stiffness

import palpate
from palpate import _native

# Six tetrahedra around a diagonal, by corners numbered x + 2 y + 4 z: neighbouring cells match.
CELL = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])


def glued_mesh(blocks: np.ndarray, cells: int, map_to_space) -> tuple[palpate.TetMesh, np.ndarray]:
    """Blocks (k, 3) of a lattice, each of ``cells`` cubes a side and a region of its own; and the lattice's points."""
    inside = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cubes = (cells * blocks[:, None] + inside).reshape(-1, 3)
    points, corners = np.unique((cubes[:, None] + CORNERS).reshape(-1, 3), axis=0, return_inverse=True)
    tets = corners.reshape(-1, 8)[:, CELL].reshape(-1, 4)
    nodes = map_to_space(points / cells)
    inverted = np.linalg.det(nodes[tets[:, 1:]] - nodes[tets[:, :1]]) < 0
    tets[inverted] = tets[inverted][:, [0, 2, 1, 3]]
    return palpate.TetMesh(nodes, tets, np.repeat(np.arange(len(blocks)), 6 * cells**3)), points


def random_body(rng: np.random.Generator, most_contrast: float = 1e6) -> palpate.Body:
    """One to five blocks, scaled along three axes, turned, of materials up to a contrast; held at one end."""
    blocks = [(0, 0, 0)]
    for _ in range(rng.integers(0, 5)):
        neighbour = np.array(blocks[rng.integers(len(blocks))])
        neighbour[rng.integers(3)] += rng.choice([-1, 1])
        blocks += [tuple(neighbour)] if tuple(neighbour) not in blocks else []
    cells = 3 if len(blocks) == 1 else 2 if len(blocks) == 2 else int(rng.integers(1, 3))
    scale = 0.01 * 10 ** rng.uniform(-0.5, 0.7, 3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]

    def placed(points):
        return (points + rng.uniform(-0.1, 0.1, points.shape) / cells) * scale @ turn.T

    mesh, points = glued_mesh(np.array(blocks), cells, placed)
    contrast = most_contrast ** rng.uniform()
    materials = {
        region: palpate.Material(1e4 * contrast ** rng.uniform(), rng.choice([0.0, 0.3, 0.45, 0.49]))
        for region in range(len(blocks))
    }
    held = points[:, 0] == points[:, 0].min()
    if rng.random() < 0.25 and len(mesh.nodes) < 60:
        corners = len(mesh.nodes)
        mesh = mesh.to_quadratic()
        held = np.concatenate([held, np.zeros(len(mesh.nodes) - corners, dtype=bool)])
    loads = palpate.Loads(gravity=tuple(rng.uniform(-10, 10, 3))) if rng.random() < 0.3 else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", palpate.LockingWarning)
        return palpate.Body(mesh, material=materials, fixed=held, loads=loads)


def random_change(rng: np.random.Generator, body: palpate.Body) -> dict:
    """Prescribed nodes, alone or as a stamp, forces, moved and released supports."""
    surface, fixed = body.mesh.surface_nodes, np.intersect1d(body.mesh.surface_nodes, body.fixed_nodes)
    free = np.setdiff1d(surface, body.fixed_nodes)
    positions = body.mesh.nodes[free]
    count = int(rng.choice([0, 1, 2, 4, 8, 16]))
    around = np.argsort(np.linalg.norm(positions - positions[rng.integers(len(free))], axis=1))
    order = around if rng.random() < 0.5 else rng.permutation(len(free))
    placed, other = free[order[:count]], free[order[count:]]
    as_one = rng.random() < 0.4
    common = 1e-3 * rng.normal(size=3)
    displacements = {int(n): common if as_one else 1e-3 * rng.normal(size=3) for n in placed}
    if rng.random() < 0.3:
        displacements = {n: (*u[:2], None) for n, u in displacements.items()}
    forces = {int(n): 0.02 * rng.normal(size=3) for n in other[: rng.integers(0, 4)]}
    change = {"displacements": displacements, "forces": forces}
    if rng.random() < 0.2:
        displacements[int(rng.choice(fixed))] = 1e-3 * rng.normal(size=3)
    if rng.random() < 0.15 and len(fixed) > 6:
        change["release"] = [int(n) for n in rng.permutation(fixed)[:2] if n not in displacements]
    return change


class DirectSolver:
    """Stiffness of scikit-fem, solved with residuals in extended precision: right to the rounding of its entries."""

    def __init__(self, body: palpate.Body):
        K = skfem_stiffness(body)
        self.K = (0.5 * (K + K.T)).tocsr().astype(np.longdouble)
        self.body = body

    def solve(self, free: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Displacements of free dofs under forces, for one or several columns."""
        scale = scipy.sparse.diags_array(1 / np.sqrt(self.K.diagonal()[free]))
        scaled = (scale @ self.K[free][:, free] @ scale).tocsr()
        factor = scipy.sparse.linalg.splu(scaled.astype(float).tocsc())
        right = scale @ right.astype(np.longdouble)
        x = np.zeros_like(right)
        for _ in range(4):
            x += factor.solve((right - scaled @ x).astype(float))
        return scale @ x

    def change(self, change: dict) -> tuple[np.ndarray, np.ndarray]:
        """Displacements and K u of all nodes."""
        released = {3 * n + k for n in change.get("release", ()) for k in range(3)}
        prescribed = {d: 0.0 for d in self.body.fixed_dofs.tolist() if d not in released}
        for node, values in change["displacements"].items():
            prescribed |= {3 * node + k: v for k, v in enumerate(values) if v is not None}
        forces = self.body.load_vector().ravel()
        for node, values in change["forces"].items():
            forces[3 * node : 3 * node + 3] += values
        dofs = np.array(sorted(prescribed))
        free = np.setdiff1d(np.arange(self.K.shape[0]), dofs)
        u = np.zeros(self.K.shape[0], dtype=np.longdouble)
        u[dofs] = [prescribed[d] for d in dofs]
        u[free] = self.solve(free, forces[free] - self.K[free][:, dofs] @ u[dofs])
        return u.astype(float).reshape(-1, 3), (self.K @ u).astype(float).reshape(-1, 3)

    def touch(self, green: palpate.GreensFunction, point, displacement, radius: float) -> tuple[np.ndarray, np.ndarray]:
        """Force on a patch whose weighted mean is prescribed, and displacements of all nodes."""
        ranks, weights = _native.contact_patch(green._core, tuple(map(float, point)), radius)
        W = np.zeros((self.K.shape[0], 3), dtype=np.longdouble)
        for rank, weight in zip(ranks, weights, strict=True):
            for axis in range(3):
                W[3 * green.surface_nodes[rank] + axis, axis] = weight
        free = np.setdiff1d(np.arange(self.K.shape[0]), self.body.fixed_dofs)
        columns = np.column_stack([W[free], self.body.load_vector().ravel()[free]])
        solved = self.solve(free, columns)
        axes = [k for k, d in enumerate(displacement) if d is not None]
        C = (W[free].T @ solved[:, :3])[np.ix_(axes, axes)]
        wanted = np.array([displacement[k] for k in axes]) - (W[free].T @ solved[:, 3])[axes]
        force = np.zeros(3, dtype=np.longdouble)
        inverse = np.linalg.inv(C.astype(float))
        for _ in range(4):
            force[axes] += inverse @ (wanted - C @ force[axes]).astype(float)
        u = np.zeros(self.K.shape[0], dtype=np.longdouble)
        u[free] = solved[:, :3] @ force + solved[:, 3]
        return force.astype(float), u.astype(float).reshape(-1, 3)
