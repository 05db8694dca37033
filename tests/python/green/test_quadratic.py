"""10-node tetrahedra against scikit-fem, SciPy and what quadratic elements must represent exactly."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
import scipy.sparse.linalg
from conftest import bent, box_mesh, direct_solve, skfem_mass, skfem_stiffness
from scipy.spatial.transform import Rotation

import palpate
from palpate.fields import Interior
from palpate.validation.verify.grids import box

RNG = np.random.default_rng(11)
SOFT = palpate.Material(8e3, 0.4, 1100.0)


def relative(a, b):
    return np.abs(a - b).max() / np.abs(b).max()


def difference(a, b):
    return abs(a - b).max() / abs(b).max()


def clamped(p):
    return p[:, 0] < 1e-9


@pytest.fixture(scope="module")
def straight() -> palpate.Body:
    mesh = box_mesh(cells=(3, 2, 2)).to_quadratic()
    regions = (mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.04).astype(int)
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, regions)
    return palpate.Body(mesh, material={0: SOFT, 1: palpate.Material(30e3, 0.3, 900.0)}, fixed=clamped)


@pytest.fixture(scope="module")
def curved() -> palpate.Body:
    return palpate.Body(bent(box_mesh(cells=(3, 2, 2)).to_quadratic()), material=SOFT, fixed=clamped)


@pytest.fixture(scope="module")
def straight_green(straight, tmp_path_factory):
    return palpate.precompute(straight, precision="f64", path=tmp_path_factory.mktemp("green") / "t10.palpate")


def test_straight_matrices_equal_scikit_fem(straight):
    assert difference(straight.stiffness(), skfem_stiffness(straight)) <= 1e-12
    assert difference(straight.mass(), skfem_mass(straight)) <= 1e-12


def test_curved_matrices_equal_scikit_fem(curved):
    """The mass is a polynomial of degree 7; the stiffness is rational, so that the rules differ by their error."""
    assert difference(curved.mass(), skfem_mass(curved, points=5)) <= 1e-12
    fine = skfem_stiffness(curved, points=6)
    assert difference(curved.stiffness(), fine) <= 1e-5
    assert difference(skfem_stiffness(curved, points=2), fine) >= 1e-4  # the map is bent enough to need more points


@pytest.mark.parametrize("kind", ["straight", "curved"])
def test_rigid_motions_cost_nothing_and_mass_is_exact(kind, request):
    body = request.getfixturevalue(kind)
    K, nodes = body.stiffness(), body.mesh.nodes
    translations = [np.tile(axis, (len(nodes), 1)) for axis in np.eye(3)]
    for motion in translations + [np.cross(axis, nodes) for axis in np.eye(3)]:
        assert np.abs(K @ motion.ravel()).max() <= 1e-10 * abs(K).max() * np.abs(motion).max()
    total = (body.mesh.volumes * body.element_materials[:, 2]).sum()
    for lumped in (False, True):
        mass = body.mass(lumped=lumped)
        for u in translations:
            assert u.ravel() @ (mass @ u.ravel()) == pytest.approx(total, rel=1e-12)
    assert mass.nnz == 3 * len(nodes)
    assert mass.diagonal().min() > 0


def test_volume_of_a_bent_body_is_that_of_its_curved_surface(curved):
    """`V = int x . n dA / 3` over the 6-node faces, by a Gauss rule over the square folded to a triangle."""
    mesh = curved.mesh
    corners = mesh.nodes[mesh.surface_faces]
    points, weights = np.polynomial.legendre.leggauss(6)
    volume = 0.0
    for u, wu in zip((points + 1) / 2, weights / 2, strict=True):
        for v, wv in zip((points + 1) / 2, weights / 2, strict=True):
            s, t = u, (1 - u) * v
            r = 1 - s - t
            n = [r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1), 4 * r * s, 4 * s * t, 4 * t * r]
            ds = [1 - 4 * r, 4 * s - 1, 0, 4 * (r - s), 4 * t, -4 * t]
            dt = [1 - 4 * r, 0, 4 * t - 1, -4 * s, 4 * s, 4 * (r - t)]
            x, xs, xt = (np.einsum("a,fai->fi", c, corners) for c in (n, ds, dt))
            volume += wu * wv * (1 - u) * np.einsum("fi,fi->", x, np.cross(xs, xt)) / 3
    assert mesh.volume == pytest.approx(volume, rel=1e-12)
    assert mesh.volume == pytest.approx(curved.mass().sum() / 3 / 1100, rel=1e-12)


@pytest.mark.parametrize("bend", [False, True])
def test_patch_test(bend):
    """A constant strain is in equilibrium inside, on curved elements too."""
    mesh = box_mesh(cells=(3, 3, 3), seed=3).to_quadratic()
    mesh = bent(mesh) if bend else mesh
    body = palpate.Body(mesh, material=palpate.Material(7e3, 0.35))
    u = mesh.nodes @ (1e-3 * RNG.normal(size=(3, 3))).T
    force = (body.stiffness() @ u.ravel()).reshape(-1, 3)
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.surface_nodes)
    assert len(inside) > 50
    assert np.abs(force[inside]).max() <= 1e-10 * np.abs(force).max()


def test_quadratic_patch_test():
    """A quadratic displacement with its constant body force is in equilibrium: `K u = M f / rho` inside."""
    mesh = box_mesh(cells=(3, 3, 3), seed=4).to_quadratic()
    e, nu = 7e3, 0.35
    body = palpate.Body(mesh, material=palpate.Material(e, nu, 1.0))
    lam, mu = nu * e / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    quadratic = RNG.normal(size=(3, 3, 3))
    quadratic = quadratic + quadratic.transpose(0, 2, 1)  # u_i = q_ijk x_j x_k / 2
    u = 0.5 * np.einsum("ijk,nj,nk->ni", quadratic, mesh.nodes, mesh.nodes)
    # div sigma = (lam + mu) grad div u + mu laplace u
    body_force = -((lam + mu) * np.einsum("jji->i", quadratic) + mu * np.einsum("ijj->i", quadratic))
    load = (body.mass() @ np.tile(body_force, len(mesh.nodes))).reshape(-1, 3)
    force = (body.stiffness() @ u.ravel()).reshape(-1, 3)
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.surface_nodes)
    assert np.abs((force - load)[inside]).max() <= 1e-10 * np.abs(force).max()
    assert np.abs(load[inside]).max() > 1e-3 * np.abs(force).max()


def test_answers_equal_a_direct_solve_on_scikit_fems_matrix(straight, straight_green):
    mesh = straight.mesh
    free = RNG.permutation(np.setdiff1d(mesh.surface_nodes, straight.fixed_nodes))
    displacements = {int(n): 1e-3 * RNG.normal(size=3) for n in free[:4]}
    forces = {int(n): 0.01 * RNG.normal(size=3) for n in free[4:8]}
    prescribed = dict.fromkeys(straight.fixed_dofs.tolist(), 0.0)
    prescribed |= {3 * n + k: d[k] for n, d in displacements.items() for k in range(3)}
    loads = np.zeros(3 * len(mesh.nodes))
    for n, f in forces.items():
        loads[3 * n : 3 * n + 3] = f
    u, f = direct_solve(straight, prescribed, loads)
    answer = straight_green.solve(displacements=displacements, forces=forces)
    assert relative(answer.displacements, u[mesh.surface_nodes]) <= 1e-9
    assert relative(answer.forces, f[mesh.surface_nodes]) <= 1e-9
    assert relative(answer.reactions, f[straight.fixed_nodes]) <= 1e-9
    assert relative(Interior(straight).extend(answer.displacements), u) <= 1e-9


def test_store_carries_the_faces(straight, straight_green, tmp_path):
    straight_green.save(tmp_path / "copy.palpate")
    copy = palpate.GreensFunction.load(tmp_path / "copy.palpate", body=straight)
    assert np.array_equal(copy.surface_faces, straight.mesh.surface_faces)
    assert np.array_equal(copy.surface_triangles, straight.mesh.surface_triangles)
    linear = palpate.Body(box_mesh(cells=(3, 2, 2)), material=SOFT, fixed=clamped)
    with pytest.raises(palpate.StoreError, match="element: quadratic there, linear here"):
        palpate.GreensFunction.load(tmp_path / "copy.palpate", body=linear)


def test_touch_is_the_weighted_mean_and_converges_to_the_shape_functions(straight, straight_green):
    """A vanishing patch in the middle of a drawn triangle, where no node is: weights are the six shape functions."""
    mesh = straight.mesh
    rows = {int(n): i for i, n in enumerate(mesh.surface_nodes)}
    face = next(f for f in mesh.surface_faces if (mesh.nodes[f[:3], 0] > 0.0799).all())
    r, s, t = 0.2, 0.3, 0.5
    shapes = np.array([r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1), 4 * r * s, 4 * s * t, 4 * t * r])
    point = shapes @ mesh.nodes[face]
    press = (-1e-3, 4e-4, None)
    exact = straight_green.touch(point, press, radius=0.0)
    assert shapes @ exact.displacements[[rows[n] for n in face]] == pytest.approx(
        [-1e-3, 4e-4, exact.displacements[[rows[n] for n in face], 2] @ shapes], rel=1e-9
    )
    reference = straight_green.solve(forces={int(n): w * exact.force for n, w in zip(face, shapes, strict=True)})
    assert relative(exact.displacements, reference.displacements) <= 1e-9
    errors = [relative(straight_green.touch(point, press, radius=a).force, exact.force) for a in (4e-4, 2e-4, 1e-6)]
    assert errors[1] < 0.3 * errors[0]  # second order in the radius
    assert errors[2] <= 1e-6


def test_a_node_pressed_at_its_place_is_a_prescribed_node(straight, straight_green):
    mesh = straight.mesh
    corner_nodes = np.unique(mesh.tets[:, :4])
    for node in (np.setdiff1d(mesh.surface_nodes, np.union1d(corner_nodes, straight.fixed_nodes))[5], corner_nodes[-1]):
        answer = straight_green.solve(displacements={int(node): (1e-3, -2e-3, 5e-4)})
        touch = straight_green.touch(mesh.nodes[node], (1e-3, -2e-3, 5e-4), radius=0.0)
        assert relative(touch.displacements, answer.displacements) <= 1e-9


def test_quadratic_elements_do_not_lock():
    """Tip deflection of a nearly incompressible cantilever, 4:1, against the beam's (Timoshenko, k = 5/6).

    The clamp, which holds the width of the section too, costs some of it.
    """
    length, width, e, nu = 0.2, 0.05, 1e5, 0.49
    inertia, area, shear = width**4 / 12, width**2, e / (2 * (1 + nu))
    beam = length**3 / (3 * e * inertia) + length / (5 / 6 * shear * area)
    found = {}
    for name, mesh in (
        ("linear", box_mesh(cells=(8, 2, 2), size=(length, width, width), jitter=0)),
        ("quadratic", box_mesh(cells=(8, 2, 2), size=(length, width, width), jitter=0).to_quadratic()),
    ):
        with contextlib.nullcontext() if mesh.is_quadratic else pytest.warns(palpate.LockingWarning):
            body = palpate.Body(mesh, material=palpate.Material(e, nu), fixed=clamped)
        tip = np.flatnonzero(mesh.nodes[:, 0] > length - 1e-9)
        K = body.stiffness()
        free = np.setdiff1d(np.arange(K.shape[0]), body.fixed_dofs)
        # A unit force shared by the nodes of the end; how does not matter far from it.
        load = np.zeros(K.shape[0])
        load[3 * tip + 2] = 1 / len(tip)
        u = np.zeros(K.shape[0])
        u[free] = scipy.sparse.linalg.spsolve(K[free][:, free], load[free])
        found[name] = u[3 * tip + 2].mean() / beam
    assert found["quadratic"] == pytest.approx(1.0, abs=0.12)
    assert found["linear"] < 0.2


def test_a_touch_beside_a_right_angled_edge_does_not_depend_on_how_the_body_is_turned():
    """A patch does not go round the edge: rounding had let it, and forces differed by up to 10 %."""
    mesh = box((5, 5, 4), (0.08, 0.08, 0.05), quadratic=True)
    held = mesh.nodes[:, 2] < 1e-9
    places = [(0.005, 0.04, 0.05), (0.04, 0.003, 0.05), (0.002, 0.002, 0.05)]
    found = []
    for turn in (Rotation.identity(), *Rotation.random(3, rng=np.random.default_rng(1))):
        body = palpate.Body(palpate.TetMesh(turn.apply(mesh.nodes.copy()), mesh.tets), material=SOFT, fixed=held)
        green = palpate.precompute(body, progress=False)
        touches = [green.touch(turn.apply(at), turn.apply((0.0, 0.0, -1e-3)), 0.012) for at in places]
        found.append([turn.inv().apply(np.array(touch.force)) for touch in touches])
    difference = np.linalg.norm(np.array(found) - found[0], axis=2)
    assert difference.max() < 1e-3 * np.linalg.norm(found[0], axis=1).min()
