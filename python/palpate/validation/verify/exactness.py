"""Patch tests, which must be exact, and convergence rates."""

from __future__ import annotations

from functools import partial

import numpy as np

from palpate.body import Body, Loads, Material
from palpate.fields import Interior, StressRecovery
from palpate.mesh import TetMesh
from palpate.mesh.elements import EDGES
from palpate.mesh.shape_functions import values
from palpate.validation.plots import plot_convergence
from palpate.validation.verify.benchmark import Check, Outcome
from palpate.validation.verify.grids import box, jittered

SIZE = (0.08, 0.05, 0.05)
SOFT = Material(8e3, 0.35)
ORDER_NAMES = {False: "4 nodes", True: "10 nodes"}


def patch_test() -> Outcome:
    """Impose a linear displacement on the surface of an irregular mesh: it must be found inside, at constant stress."""
    gradient = 1e-3 * np.random.default_rng(2).normal(size=(3, 3))
    strain = (gradient + gradient.T) / 2
    lam, mu = _lame(SOFT)
    stress = lam * np.trace(strain) * np.eye(3) + 2 * mu * strain
    checks = []
    for label, mesh in _irregular_meshes():
        body = Body(mesh, material=SOFT, fixed=lambda p: p[:, 0] < 1e-9)
        exact = mesh.nodes @ gradient.T
        surface = exact[mesh.surface_nodes]
        inside = np.abs(Interior(body).extend(surface) - exact).max() / np.abs(exact).max()
        recovered = StressRecovery(body).recover(surface).stress
        off = np.abs(recovered - stress).max() / np.abs(stress).max()
        checks += [
            Check(f"{label}: displacement inside, largest error", float(inside), 0.0, "linear field", 1e-10),
            Check(f"{label}: stress, largest error", float(off), 0.0, "Hooke's law", 1e-10),
        ]
    return Outcome(checks)


def rigid_motions() -> Outcome:
    """Rigid motions: a body moved or turned as a whole feels no force, and nothing else does that."""
    checks = []
    for label, mesh in _irregular_meshes():
        stiffness = Body(mesh, material=SOFT).stiffness()
        centred = mesh.nodes - mesh.nodes.mean(axis=0)
        motions = [np.tile(axis, (len(mesh.nodes), 1)) for axis in np.eye(3)]
        motions += [np.cross(axis, centred) / np.abs(centred).max() for axis in np.eye(3)]
        force = max(np.abs(stiffness @ motion.ravel()).max() for motion in motions) / abs(stiffness).max()
        least = np.linalg.eigvalsh(stiffness.toarray())
        zero = int((least < 1e-10 * least[-1]).sum())
        checks += [
            Check(f"{label}: largest force over max K", float(force), 0.0, "statics", 1e-10),
            Check(f"{label}: motions without force", zero, 6, "statics", 0.0),
        ]
    return Outcome(checks)


def convergence() -> Outcome:
    """Error in the mean square of a smooth displacement, with the body force it needs, as the mesh is refined."""
    checks, series = [], {}
    for quadratic, counts in ((False, (4, 8, 16)), (True, (2, 4, 8))):
        errors = [_manufactured_error(count, quadratic) for count in counts]
        order = float(np.log2(errors[-2] / errors[-1]))
        name = ORDER_NAMES[quadratic]
        expected = 3 if quadratic else 2
        checks.append(Check(f"{name}: order of convergence", order, expected, "a priori estimate, L2 norm", 0.1))
        series[name] = (1 / np.array(counts), np.array(errors))
    plot = partial(plot_convergence, series, {"4 nodes": 2, "10 nodes": 3})
    return Outcome(checks, {"convergence.png": plot})


def _irregular_meshes() -> list[tuple[str, TetMesh]]:
    straight = jittered(box((4, 3, 3), SIZE, quadratic=False), 0.25, seed=1)
    tenfold = jittered(box((3, 2, 2), SIZE, quadratic=False), 0.25, seed=1).to_quadratic()
    x, y, z = tenfold.nodes.T / SIZE[0]
    bent = np.column_stack([x + 0.2 * y * z, y + 0.3 * x**2, z + 0.25 * np.sin(2 * x) * (1 + y)])
    curved = TetMesh(SIZE[0] * bent, tenfold.tets)
    return [("4 nodes", straight), ("10 nodes", tenfold), ("10 nodes, curved", curved)]


def _manufactured_error(cells: int, quadratic: bool) -> float:
    """Relative L2 error on a unit cube whose surface follows the exact displacement."""
    mesh = box((cells,) * 3, (1, 1, 1), quadratic=quadratic)
    material = Material(1.0, 0.3, density=1.0)
    unloaded = Body(mesh, material=material, fixed=mesh.surface_nodes)
    # With unit density the mass matrix integrates the interpolated body force against the shape functions.
    force = (unloaded.mass() @ _body_force(mesh.nodes, material).ravel()).reshape(-1, 3)
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.surface_nodes)
    # The solve for the interior takes all surface nodes as given; a support is asked for by the rules of a body.
    support = [int(mesh.surface_nodes[0])]
    loads = Loads(forces={int(node): force[node] for node in inside})
    body = Body(mesh, material=material, fixed=support, loads=loads)
    found = Interior(body).extend(_smooth(mesh.nodes)[mesh.surface_nodes])
    return _l2_error(mesh, found)


WAVES = np.array([[1.0, 0.7, 1.3], [0.8, 1.2, 0.6], [1.1, 0.9, 1.0]])
PHASES = np.array([0.3, 1.1, 2.0])


def _smooth(x: np.ndarray) -> np.ndarray:
    """`u_i = sin(k_i . x + phase_i)`."""
    return np.sin(x @ WAVES.T + PHASES)


def _body_force(x: np.ndarray, material: Material) -> np.ndarray:
    """`b = -(lam + mu) grad div u - mu laplace u`, with `u_j,ji = -k_jj k_ji u_j` (second indices: axes of a wave)."""
    lam, mu = _lame(material)
    u = _smooth(x)
    grad_div = -np.einsum("nj,jj,ji->ni", u, WAVES, WAVES)
    return -(lam + mu) * grad_div + mu * (WAVES**2).sum(axis=1) * u


def _l2_error(mesh: TetMesh, found: np.ndarray) -> float:
    """Integrated over the straight-edged elements by Gauss-Jacobi points, not at nodes, where errors are smaller."""
    from scipy.special import roots_jacobi

    (u, wu), (v, wv), (w, ww) = (roots_jacobi(4, power, 0) for power in (2, 1, 0))
    u, v, w = np.meshgrid((1 + u) / 2, (1 + v) / 2, (1 + w) / 2, indexing="ij")
    weights = np.einsum("i,j,k->ijk", wu, wv, ww).ravel()
    second, third, fourth = u, (1 - u) * v, (1 - u) * (1 - v) * w
    points = np.stack([1 - second - third - fourth, second, third, fourth], axis=-1).reshape(-1, 4)
    shapes = values(points, mesh.tets.shape[1], EDGES)
    exact = _smooth(np.einsum("pc,ecx->epx", points, mesh.nodes[mesh.tets[:, :4]]).reshape(-1, 3))
    at_points = np.einsum("pn,enx->epx", shapes, found[mesh.tets]).reshape(-1, 3)
    weight = np.outer(mesh.volumes, weights / weights.sum()).ravel()
    squares = [weight @ (field**2).sum(axis=1) for field in (at_points - exact, exact)]
    return float(np.sqrt(squares[0] / squares[1]))


def _lame(material: Material) -> tuple[float, float]:
    e, nu = material.youngs_modulus, material.poissons_ratio
    return nu * e / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
