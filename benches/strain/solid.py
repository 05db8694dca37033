"""Solids of 10-node tetrahedra at finite strain under a rigid, frictionless sphere: full Newton's method.

Total Lagrangian, four points of quadrature an element. Pressures at points of the surface keep the sphere out, by the
method of augmented Lagrangians. Bodies of more than 20,000 unknowns need `pypardiso` (extra `bench`): SuperLU takes
minutes for each of some hundred factorisations.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from benches.strain.axisymmetric import DivergedError
from benches.strain.materials import Material
from palpate import TetMesh
from palpate.mesh.elements import EDGES

try:
    from pypardiso import PyPardisoSolver
except ImportError:
    PyPardisoSolver = None

# Stiffness of the penalty over E / R.
PENALTY = 60.0
# Largest residual of a solution over the force; most steps to it; change of the force by the last update of pressures;
# most updates.
TOLERANCE, MOST_STEPS, SETTLED, MOST_UPDATES = 1e-6, 25, 1e-3, 12
# Longest step over the radius, and least share of a step that is tried.
LONGEST_STEP, LEAST_SHARE = 0.2, 0.03
# Longest and shortest step of the sphere over its radius.
LONGEST_PRESS, SHORTEST_PRESS = 0.15, 0.01
# Points along an edge of each face at which the sphere is kept out.
FACE_POINTS = 6

_A, _B = 0.5854101966249685, 0.1381966011250105
_POINTS = np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]])


class Solid:
    """A supported body of one material.

    Parameters
    ----------
    mesh
        10-node tetrahedra.
    material
        Its material.
    held
        Mask (n,) of the nodes that are held.

    """

    def __init__(self, mesh: TetMesh, material: Material, held: np.ndarray):
        self.mesh, self.material = mesh, material
        self.u = np.zeros_like(mesh.nodes)
        self._free = np.flatnonzero(np.repeat(~held, 3))
        self._slopes, self._weights = _gradients(mesh.nodes[mesh.tets])
        dofs = (3 * mesh.tets[:, :, None] + np.arange(3)).reshape(len(mesh.tets), 30)
        self._dofs, self._rows, self._columns = dofs, np.repeat(dofs, 30, 1).ravel(), np.tile(dofs, (1, 30)).ravel()
        self._faces = np.asarray(mesh.surface_faces)
        self._shapes, share = _face_points(FACE_POINTS)
        corners = mesh.nodes[self._faces[:, :3]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._areas = 0.5 * np.linalg.norm(normal, axis=1)[:, None] * share
        self._pressures = np.zeros_like(self._areas)

    def press(self, centre: np.ndarray, radius: float, updates: int = MOST_UPDATES) -> np.ndarray:
        """Put the sphere's centre at a place, m; return the force on the sphere (3,), N.

        Fewer updates of the pressures leave a part of the depth to the penalty: enough on the way to a depth.

        Raises
        ------
        DivergedError
            Newton's method has not converged.

        """
        last = np.inf
        for _ in range(updates):
            force = self._balance(centre, radius)
            self._pressures = self._pressed(centre, radius)[0]
            size = np.linalg.norm(force)
            if abs(size - last) <= SETTLED * size:
                return force
            last = size
        if updates < MOST_UPDATES:
            return force
        raise DivergedError("the pressures have not settled")

    def pressed(self, place: np.ndarray, normal: np.ndarray, radius: float, depths: np.ndarray) -> list[float]:
        """Press the sphere at a place of an outward normal to ascending depths, m; return forces along the normal, N.

        A step begins with the displacement of the last one once more; one that fails is divided, and the next is longer
        again. The forces are fewer than the depths where none converges.
        """
        found, reached, force, rate, step = [], 0.0, np.zeros(3), np.zeros_like(self.u), LONGEST_PRESS * radius
        for depth in depths:
            while reached < depth:
                # No short step is left over.
                trial = depth if depth - reached < 1.3 * step else reached + step
                before = self.u.copy(), self._pressures.copy()
                try:
                    self.u = before[0] + (trial - reached) * rate
                    centre = place + normal * (radius - trial)
                    force = self.press(centre, radius, MOST_UPDATES if trial == depth else 1)
                except DivergedError:
                    (self.u, self._pressures), rate = before, np.zeros_like(self.u)
                    step = 0.5 * (trial - reached)
                    if step < SHORTEST_PRESS * radius:
                        return found
                    continue
                rate, reached = (self.u - before[0]) / (trial - reached), trial
                step = min(1.4 * step, LONGEST_PRESS * radius)
            found.append(abs(float(force @ normal)))
        return found

    def _balance(self, centre: np.ndarray, radius: float) -> np.ndarray:
        step, share = np.zeros_like(self.u), 1.0
        for _ in range(MOST_STEPS):
            try:
                forces, tangent = self._internal()
            except DivergedError:
                share *= 0.5
                if share < LEAST_SHARE:
                    raise
                self.u -= share * step
                continue
            pushed, contact, force = self._contact(centre, radius)
            residual = (forces + pushed)[self._free]
            if np.abs(residual).max() <= TOLERANCE * max(np.linalg.norm(force), 1e-9):
                return force
            whole = (tangent + contact)[self._free][:, self._free].tocsc()
            change = np.zeros(self.u.size)
            change[self._free] = -_solved(whole, residual)
            share = min(1.0, LONGEST_STEP * radius / np.abs(change).max())
            step = change.reshape(-1, 3)
            self.u += share * step
        raise DivergedError(f"residual {np.abs(residual).max():g} N")

    def _internal(self) -> tuple[np.ndarray, sparse.csc_matrix]:
        f = np.eye(3) + np.einsum("eai,eqaj->eqij", self.u[self.mesh.tets], self._slopes)
        stress, moduli = _stress(self.material, f)
        forces = np.zeros(self.u.size)
        own = np.einsum("eq,eqij,eqaj->eai", self._weights, stress, self._slopes, optimize=True)
        np.add.at(forces, self._dofs, own.reshape(len(own), 30))
        half = np.einsum("eq,eqijkl,eqbl->eqijbk", self._weights, moduli, self._slopes, optimize=True)
        blocks = np.einsum("eqaj,eqijbk->eaibk", self._slopes, half, optimize=True)
        size = self.u.size
        return forces, sparse.csc_matrix((blocks.ravel(), (self._rows, self._columns)), (size, size))

    def _pressed(self, centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return pressures (k, q), Pa, outward normals of the tool (k, q, 3) and distances from its core, m."""
        offset = self._offset(centre)
        distance = np.linalg.norm(offset, axis=2)
        pressures = np.maximum(self._pressures + self._penalty(radius) * (radius - distance), 0.0)
        return pressures, offset / distance[..., None], distance

    def _penalty(self, radius: float) -> float:
        """Return the pressure over the depth, Pa/m."""
        return PENALTY * self.material.youngs_modulus / radius

    def _offset(self, centre: np.ndarray) -> np.ndarray:
        """Return vectors (k, q, 3) from the tool's core, a sphere's centre, to the points of the faces, m."""
        return np.einsum("qi,kic->kqc", self._shapes, (self.mesh.nodes + self.u)[self._faces]) - centre

    def _round(self, centre: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return the directions in which the tool is round, as a matrix, and the normal."""
        return np.eye(3)

    def _contact(self, centre: np.ndarray, radius: float) -> tuple[np.ndarray, sparse.csc_matrix, np.ndarray]:
        """Return forces against the body's, the stiffness and the force on the sphere (3,), N."""
        pressures, normals, distance = self._pressed(centre, radius)
        loads = -(pressures * self._areas)[..., None] * normals
        forces = np.zeros(self.u.shape)
        np.add.at(forces, self._faces, np.einsum("kqc,qi->kic", loads, self._shapes))
        near = np.flatnonzero((pressures > 0.0).any(axis=1))
        n, p, area = normals[near], pressures[near], self._areas[near]
        along = n[..., :, None] * n[..., None, :]
        local = (self._penalty(radius) * (p > 0))[..., None, None] * along
        local -= (p / distance[near])[..., None, None] * (self._round(centre, near) - along)
        blocks = np.einsum("kq,kqcd,qi,qj->kicjd", area, local, self._shapes, self._shapes, optimize=True)
        dofs = (3 * self._faces[near][:, :, None] + np.arange(3)).reshape(len(near), 18)
        rows, columns = np.repeat(dofs, 18, 1).ravel(), np.tile(dofs, (1, 18)).ravel()
        size = self.u.size
        matrix = sparse.csc_matrix((blocks.ravel(), (rows, columns)), (size, size))
        # What pushes the body down pushes the sphere up.
        return forces.ravel(), matrix, loads.sum(axis=(0, 1))


def _solved(matrix: sparse.csc_matrix, right: np.ndarray) -> np.ndarray:
    """Solve with a symmetric matrix, which need not be positive."""
    if PyPardisoSolver is None:
        return splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(right)
    return solved_with_inertia(matrix, right)[0]


def solved_with_inertia(matrix: sparse.csc_matrix, right: np.ndarray) -> tuple[np.ndarray, int]:
    """Solve with a symmetric matrix by `pypardiso`; return the number of its negative eigenvalues too."""
    if PyPardisoSolver is None:
        raise RuntimeError("this solution needs pypardiso: pip install 'palpate[bench]'")
    solver = PyPardisoSolver(mtype=-2)
    found = solver.solve(sparse.triu(matrix, format="csr"), right)
    negative = int(solver.get_iparm(23))
    solver.free_memory(everything=True)
    return found, negative


def _stress(material: Material, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first Piola stress and its derivative by the deformation gradient."""
    c, i1, i2, j = invariants(f)
    inverse = np.linalg.inv(f)
    w = material.density(i1, i2, j)
    against = np.swapaxes(inverse, -1, -2)
    gradients = [2.0 * f, 2.0 * i1[..., None, None] * f - 2.0 * f @ c, j[..., None, None] * against]
    stress = sum(first[..., None, None] * g for first, g in zip(w.first, gradients, strict=True))
    identity = np.eye(3)
    moduli = np.zeros((*f.shape, 3, 3))
    for i, gi in enumerate(gradients):
        for k, gk in enumerate(gradients):
            if np.any(w.second[i][k]):
                moduli += (
                    w.second[i][k][..., None, None, None, None] * gi[..., :, :, None, None] * gk[..., None, None, :, :]
                )
    pair = np.einsum("ik,jl->ijkl", identity, identity)
    moduli += w.first[0][..., None, None, None, None] * 2.0 * pair
    if np.any(w.first[1]):
        moduli += w.first[1][..., None, None, None, None] * _second_of_i2(f, c, i1)
    across = np.einsum("...ji,...lk->...ijkl", inverse, inverse) - np.einsum("...jk,...li->...ijkl", inverse, inverse)
    return stress, moduli + (w.first[2] * j)[..., None, None, None, None] * across


def invariants(f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return `C = F^T F`, `I1`, `I2` and `J` of deformation gradients.

    Raises
    ------
    DivergedError
        An element is turned over.

    """
    c, j = np.einsum("...ki,...kj", f, f), np.linalg.det(f)
    if not (j > 0.0).all():
        raise DivergedError("an element is turned over")
    i1 = np.einsum("...ii", c)
    return c, i1, 0.5 * (i1**2 - np.einsum("...ij,...ij", c, c)), j


def _second_of_i2(f: np.ndarray, c: np.ndarray, i1: np.ndarray) -> np.ndarray:
    """Return the second derivative of `I2` by the deformation gradient: `d(2 I1 F - 2 F C)/dF`."""
    identity = np.eye(3)
    left = f @ np.swapaxes(f, -1, -2)
    found = 4.0 * np.einsum("...ij,...kl->...ijkl", f, f)
    found = found + 2.0 * i1[..., None, None, None, None] * np.einsum("ik,jl->ijkl", identity, identity)
    found = found - 2.0 * np.einsum("ik,...lj->...ijkl", identity, c)
    found = found - 2.0 * np.einsum("...il,...kj->...ijkl", f, f)
    return found - 2.0 * np.einsum("...ik,jl->...ijkl", left, identity)


def _gradients(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradients (m, 4, 10, 3) of the shape functions, 1/m, and volumes (m, 4) of the points, m^3."""
    slopes = np.zeros((4, 10, 3))
    for q, xi in enumerate(_POINTS):
        corner = np.array([1.0 - xi.sum(), *xi])
        by_xi = np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        slopes[q, :4] = (4.0 * corner - 1.0)[:, None] * by_xi
        for k, (a, b) in enumerate(EDGES):
            slopes[q, 4 + k] = 4.0 * (corner[a] * by_xi[b] + corner[b] * by_xi[a])
    jacobian = np.einsum("eai,qaj->eqij", at, slopes)
    return np.einsum("qaj,eqji->eqai", slopes, np.linalg.inv(jacobian)), np.linalg.det(jacobian) / 24.0


def _face_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return shape functions (q, 6) at the middles of small triangles of a face, and their shares of its area (q,)."""
    points = [(i + s, k + s) for i in range(count) for k in range(count - i) for s in (1 / 3,)]
    points += [(i + 2 / 3, k + 2 / 3) for i in range(count) for k in range(count - i - 1)]
    x, y = np.array(points).T / count
    l0, l1, l2 = 1.0 - x - y, x, y
    corners = [li * (2.0 * li - 1.0) for li in (l0, l1, l2)]
    shapes = np.stack([*corners, 4.0 * l0 * l1, 4.0 * l1 * l2, 4.0 * l2 * l0], 1)
    return shapes, np.full(len(points), 1.0 / len(points))
