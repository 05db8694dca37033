"""Axisymmetric bodies at finite strain under a rigid, frictionless tool: 9-node elements, full Newton's method.

Pressures at Gauss points of the surface keep the tool out, by the method of augmented Lagrangians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from benches.strain.materials import Material

# Stiffness of the penalty over E / R. Pressures are found by the method of augmented Lagrangians; a larger one loses
# the contact.
PENALTY = 150.0
# Relative change of the force in the last update of pressures, and most updates.
SETTLED = 5e-4
MOST_UPDATES = 12
# Largest residual of a solution over the force, and most steps to it.
TOLERANCE = 1e-6
MOST_STEPS = 20
# Least share of a step that is tried before the load is divided.
LEAST_STEP = 0.03

# Shortest step of a tool over its radius.
SHORTEST = 0.02


class DivergedError(Exception):
    """Newton's method has not converged."""


@dataclass(frozen=True)
class Sphere:
    """A sphere whose lowest point is at the height `tip`."""

    radius: float

    def gap(self, r: np.ndarray, z: np.ndarray, tip: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the depth of points in the tool, positive inside, its gradient (2, ...) and second derivatives."""
        v = np.stack([r, z - (tip + self.radius)])
        length = np.sqrt((v * v).sum(0))
        unit = v / length
        return self.radius - length, -unit, -_across(unit) / length


@dataclass(frozen=True)
class Punch:
    """A cylinder with a flat end and a rounded edge; its end is at the height `tip`."""

    radius: float
    rounding: float

    def gap(self, r: np.ndarray, z: np.ndarray, tip: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the depth of points in the tool, positive inside, its gradient (2, ...) and second derivatives."""
        flat = self.radius - self.rounding
        v = np.stack([np.maximum(r - flat, 0.0), z - (tip + self.rounding)])
        length = np.sqrt((v * v).sum(0))
        unit = v / length
        return self.rounding - length, -unit, np.where(r > flat, -_across(unit) / length, 0.0)


def _across(unit: np.ndarray) -> np.ndarray:
    """Return the projection (2, 2, ...) across unit vectors (2, ...)."""
    identity = np.eye(2).reshape(2, 2, *([1] * (unit.ndim - 1)))
    return identity - unit[:, None] * unit[None]


def graded(fine: float, until: float, growth: float, end: float) -> np.ndarray:
    """Return coordinates from 0 to `end`: steps of `fine` up to `until`, then each larger by the factor `growth`."""
    count = max(1, round(until / fine))
    points = list(np.linspace(0.0, until, count + 1))
    step = until / count
    while points[-1] < end - 1e-12 * end:
        step *= growth
        left = end - points[-1]
        points.append(end if left < 1.5 * step else points[-1] + step)
    return np.array(points)


def top_height(r: np.ndarray, curvature: float) -> np.ndarray:
    """Return heights of a curved top, m, at distances r, m, from its middle; a convex one has a positive curvature."""
    return -0.5 * curvature * r**2 / np.sqrt(1.0 + (curvature * r) ** 2)


def with_curved_top(nodes: np.ndarray, r: np.ndarray, curvature: float) -> np.ndarray:
    """Move nodes (n, k), m, whose last coordinate is the height and is 0 at the top; the lower end stays flat."""
    moved = nodes.copy()
    z = nodes[:, -1]
    moved[:, -1] += top_height(r, curvature) * (1.0 - z / z.min())
    return moved


@dataclass
class Cylinder:
    """A cylinder of 9-node elements, bonded or lying on a smooth table at its lower end.

    Attributes
    ----------
    r, z
        Coordinates of the corners, m; `z` from 0 at the top downwards as negative heights, descending.
    material
        Its material.
    bonded
        Whether the lower end is bonded; otherwise it may slide.
    clamped_rim
        Whether the outer side is held.
    curvature
        Of the top at its middle, 1/m.
    """

    r: np.ndarray
    z: np.ndarray
    material: Material
    bonded: bool = True
    clamped_rim: bool = False
    free_below: bool = False
    curvature: float = 0.0
    u: np.ndarray = field(init=False)
    step: np.ndarray = field(init=False)
    depth: float = field(init=False)
    pressures: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Set up nodes, elements and quadrature."""
        middles = [np.sort(np.concatenate([c, 0.5 * (c[1:] + c[:-1])])) for c in (self.r, np.sort(self.z))]
        rows = np.stack(np.meshgrid(*middles, indexing="ij"), -1)
        self.shape = rows.shape[:2]
        flat = rows.reshape(-1, 2)
        self.nodes = with_curved_top(flat, flat[:, 0], self.curvature)
        self.u, self.step, self.depth = np.zeros_like(self.nodes), np.zeros_like(self.nodes), 0.0
        number = np.arange(len(self.nodes)).reshape(self.shape)
        n, m = len(self.r) - 1, len(self.z) - 1
        local = [number[i : i + 2 * n - 1 : 2, j : j + 2 * m - 1 : 2].ravel() for i in range(3) for j in range(3)]
        self.elements = np.stack(local, 1)
        self._quadrature()
        self._top(number)
        self._supports(number)
        dofs = (2 * self.elements[:, :, None] + np.arange(2)).reshape(len(self.elements), 18)
        self._dofs = dofs
        self._rows, self._columns = np.repeat(dofs, 18, 1).ravel(), np.tile(dofs, (1, 18)).ravel()

    def _quadrature(self) -> None:
        points, weights = np.polynomial.legendre.leggauss(3)
        value, slope = _quadratic(points)
        shape = np.einsum("qi,pj->qpij", value, value).reshape(9, 9)
        by_x = np.einsum("qi,pj->qpij", slope, value).reshape(9, 9)
        by_y = np.einsum("qi,pj->qpij", value, slope).reshape(9, 9)
        at = self.nodes[self.elements]
        jacobian = np.einsum("xqi,eic->eqxc", np.stack([by_x, by_y]), at)
        by_place = np.einsum("eqcx,xqi->ceqi", np.linalg.inv(jacobian), np.stack([by_x, by_y]))
        n_r, n_z = by_place
        radius = np.einsum("qi,ei->eq", shape, at[:, :, 0])
        count = len(self.elements)
        b = np.zeros((count, 9, 5, 9, 2))
        b[:, :, 0, :, 0], b[:, :, 1, :, 0] = n_r, n_z
        b[:, :, 2, :, 1], b[:, :, 3, :, 1] = n_r, n_z
        b[:, :, 4, :, 0] = shape / radius[:, :, None]
        self._b = b.reshape(count, 9, 5, 18)
        area = np.outer(weights, weights).ravel() * np.linalg.det(jacobian)
        self._weight = 2.0 * np.pi * radius * area

    def _top(self, number: np.ndarray) -> None:
        points, weights = np.polynomial.legendre.leggauss(6)
        value, slope = _quadratic(points)
        top = number[:, -1]
        edges = np.stack([top[0:-2:2], top[1:-1:2], top[2::2]], 1)
        at = self.nodes[edges]
        radius = at[:, :, 0] @ value.T
        length = np.linalg.norm(np.einsum("eic,qi->eqc", at, slope), axis=2)
        self._edges, self._edge_shape = edges, value
        self._edge_weight = 2.0 * np.pi * radius * weights * length
        self.pressures = np.zeros_like(radius)

    def _supports(self, number: np.ndarray) -> None:
        fixed = [2 * number[0]]
        if not self.free_below:
            fixed.append(2 * number[:, 0] + 1)
            if self.bonded:
                fixed.append(2 * number[:, 0])
        if self.clamped_rim:
            fixed += [2 * number[-1], 2 * number[-1] + 1]
        free = np.ones(2 * len(self.nodes), bool)
        free[np.concatenate(fixed)] = False
        self._free = np.flatnonzero(free)

    def _internal(self, u: np.ndarray, second: bool) -> tuple[np.ndarray, sparse.csc_matrix | None]:
        """Return internal forces, N, infinite if an element is turned over, and the stiffness."""
        x = np.einsum("eqki,ei->eqk", self._b, u.ravel()[self._dofs]) + np.array([1.0, 0.0, 0.0, 1.0, 1.0])
        gradients, hessians, invariants = _invariants(x)
        if not (invariants[2] > 0.0).all():
            return np.full(u.size, np.inf), None
        w = self.material.density(*invariants)
        stress = sum(first[..., None] * g for first, g in zip(w.first, gradients, strict=True))
        forces = np.zeros(u.size)
        np.add.at(forces, self._dofs, np.einsum("eq,eqk,eqki->ei", self._weight, stress, self._b))
        if not second:
            return forces, None
        tangent = sum(first[..., None, None] * h for first, h in zip(w.first, hessians, strict=True))
        for i, gi in enumerate(gradients):
            for k, gk in enumerate(gradients):
                tangent = tangent + w.second[i][k][..., None, None] * (gi[..., :, None] * gk[..., None, :])
        right = np.matmul(tangent * self._weight[..., None, None], self._b)
        blocks = np.einsum("eqki,eqkj->eij", self._b, right, optimize=True)
        size = u.size
        return forces, sparse.csc_matrix((blocks.ravel(), (self._rows, self._columns)), (size, size))

    def _contact(self, u: np.ndarray, tool: Sphere | Punch, tip: float, second: bool) -> tuple:
        """Return forces of the penalty against the body's, the stiffness, and the force on the tool upwards, N."""
        at = self._edge_shape @ (self.nodes + u)[self._edges]
        depth, slope, curve = tool.gap(at[..., 0], at[..., 1], tip)
        pressed = np.maximum(self.pressures + self._penalty(tool) * depth, 0.0) * self._edge_weight
        forces = np.zeros((len(self.nodes), 2))
        pushed = np.moveaxis(pressed * slope, 0, -1)
        np.add.at(forces, self._edges, np.einsum("eqc,qi->eic", pushed, self._edge_shape))
        force = float((pressed * slope[1]).sum())
        if not second:
            return forces.ravel(), None, force
        inside = self._penalty(tool) * self._edge_weight * (pressed > 0.0)
        local = inside * slope[:, None] * slope[None] + pressed * curve
        blocks = np.einsum("cdeq,qi,qj->eicjd", local, self._edge_shape, self._edge_shape, optimize=True)
        dofs = (2 * self._edges[:, :, None] + np.arange(2)).reshape(len(self._edges), 6)
        size = u.size
        rows, columns = np.repeat(dofs, 6, 1).ravel(), np.tile(dofs, (1, 6)).ravel()
        return forces.ravel(), sparse.csc_matrix((blocks.ravel(), (rows, columns)), (size, size)), force

    def press(self, tool: Sphere | Punch, depth: float) -> float:
        """Press the tool to a depth, m, from the state of before; return the force, N.

        Raises
        ------
        DivergedError
            Newton's method has not converged.

        """
        before, u, last = self.pressures, self.u + self.step * (depth - self.depth), np.inf
        try:
            for _ in range(MOST_UPDATES):
                u, force = self._balanced(u, tool, depth)
                self.pressures = self._pressures(u, tool, depth)
                if abs(force - last) <= SETTLED * force:
                    self.step = (u - self.u) / (depth - self.depth)
                    self.u, self.depth = u, depth
                    return force
                last = force
        except DivergedError:
            self.pressures = before
            self.step[:] = 0.0
            raise
        raise DivergedError(f"at a depth of {depth:g} m")

    def _pressures(self, u: np.ndarray, tool: Sphere | Punch, depth: float) -> np.ndarray:
        """Return the pressures of a state, Pa."""
        at = self._edge_shape @ (self.nodes + u)[self._edges]
        entered, _, _ = tool.gap(at[..., 0], at[..., 1], -depth)
        return np.maximum(self.pressures + self._penalty(tool) * entered, 0.0)

    def _penalty(self, tool: Sphere | Punch) -> float:
        """Return the stiffness of the penalty, Pa/m."""
        return PENALTY * self.material.youngs_modulus / tool.radius

    def _balanced(self, u: np.ndarray, tool: Sphere | Punch, depth: float) -> tuple[np.ndarray, float]:
        """Return the state in which forces are in balance, and the force on the tool, N."""
        residual, k, force = self._residual(u, tool, depth, True)
        for _ in range(MOST_STEPS):
            if np.abs(residual).max() <= TOLERANCE * max(abs(force), 1e-12):
                return u, force
            step = np.zeros(u.size)
            step[self._free] = -splu(k, permc_spec="MMD_AT_PLUS_A").solve(residual)
            u = self._shortened(u, step, residual, tool, depth)
            residual, k, force = self._residual(u, tool, depth, True)
        raise DivergedError(f"at a depth of {depth:g} m")

    def _residual(self, u: np.ndarray, tool: Sphere | Punch, depth: float, second: bool) -> tuple:
        """Return the forces out of balance at free dofs, N, the tangent there and the force on the tool, N."""
        internal, k = self._internal(u, second)
        if second and k is None:
            raise DivergedError("an element is turned over")
        pushed, contact_k, force = self._contact(u, tool, -depth, second)
        tangent = (k + contact_k)[self._free][:, self._free].tocsc() if second else None
        return (internal + pushed)[self._free], tangent, force

    def _shortened(
        self, u: np.ndarray, step: np.ndarray, residual: np.ndarray, tool: Sphere | Punch, depth: float
    ) -> np.ndarray:
        """Return the state after as much of a step as reduces the work along it.

        Energies are no measure: those of a large body cancel to round-off.
        """
        along, share = abs(residual @ step[self._free]), 1.0
        while share > LEAST_STEP:
            trial = u + share * step.reshape(-1, 2)
            reached, _, _ = self._residual(trial, tool, depth, False)
            # Points that begin to touch may double the work once.
            if np.isfinite(reached).all() and abs(reached @ step[self._free]) <= 2.0 * along:
                return trial
            share *= 0.5
        raise DivergedError(f"at a depth of {depth:g} m")


def forces(
    body: Cylinder, tool: Sphere | Punch, depths: np.ndarray, on_press: Callable[[float, float], None] | None = None
) -> np.ndarray:
    """Press to each of ascending depths, m; return the forces, N. A step that fails is divided.

    The forces are fewer than the depths where elements below the rim of the contact are turned over.
    """
    reached, found = 0.0, []
    for depth in depths:
        step = depth - reached
        while reached < depth:
            trial = min(depth, reached + step)
            try:
                force = body.press(tool, trial)
            except (DivergedError, RuntimeError):
                step *= 0.5
                if step < SHORTEST * tool.radius:
                    return np.array(found)
                continue
            reached = trial
        if on_press is not None:
            on_press(depth, force)
        found.append(force)
    return np.array(found)


def _quadratic(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return shape functions of three nodes on [-1, 1], and their derivatives, (k, 3)."""
    value = np.stack([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)], 1)
    return value, np.stack([x - 0.5, -2.0 * x, x + 0.5], 1)


def _invariants(x: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Return gradients (..., 5) and second derivatives (..., 5, 5) of `I1`, `I2`, `J`, and these.

    The last axis of `x` is (F_rr, F_rz, F_zr, F_zz, F_tt).
    """
    a, b, c, d, e = np.moveaxis(x, -1, 0)
    zero = np.zeros_like(a)
    plane, det = a * a + b * b + c * c + d * d, a * d - b * c
    by_det = np.stack([d, -c, -b, a, zero], -1)
    h_det = np.zeros((5, 5))
    h_det[0, 3] = h_det[3, 0] = 1.0
    h_det[1, 2] = h_det[2, 1] = -1.0
    axis = np.eye(5)[4]
    first = np.concatenate([x[..., :4], np.zeros_like(x[..., :1])], -1)
    g2 = 2.0 * (e * e)[..., None] * first + 2.0 * det[..., None] * by_det + 2.0 * (e * plane)[..., None] * axis
    cross = first[..., :, None] * axis
    h2 = 2.0 * (e * e)[..., None, None] * np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
    h2 = h2 + 2.0 * by_det[..., :, None] * by_det[..., None, :] + 2.0 * det[..., None, None] * h_det
    h2 = h2 + 4.0 * e[..., None, None] * (cross + np.swapaxes(cross, -1, -2))
    h2 = h2 + 2.0 * plane[..., None, None] * np.outer(axis, axis)
    gj = e[..., None] * by_det + det[..., None] * axis
    cross = by_det[..., :, None] * axis
    hj = e[..., None, None] * h_det + cross + np.swapaxes(cross, -1, -2)
    h1 = np.broadcast_to(2.0 * np.eye(5), h2.shape)
    return [2.0 * x, g2, gj], [h1, h2, hj], [plane + e * e, e * e * plane + det * det, e * det]
