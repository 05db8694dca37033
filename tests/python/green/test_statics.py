"""Finite elements and the capacitance matrix algorithm against scikit-fem and SciPy's direct solver."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh, direct_solve, relative, skfem_stiffness

import palpate
from palpate.fields import Interior

RNG = np.random.default_rng(7)


def test_stiffness_equals_scikit_fem(block):
    K, reference = block.stiffness(), skfem_stiffness(block)
    assert abs(K - reference).max() <= 1e-12 * abs(reference).max()


def test_materials_by_region_equal_scikit_fem():
    mesh = box_mesh()
    regions = (mesh.nodes[mesh.tets].mean(axis=1)[:, 0] > 0.04).astype(int)
    mesh = palpate.TetMesh(mesh.nodes, mesh.tets, regions)
    stiff = {0: palpate.Material(5e3, 0.45), 1: palpate.Material(40e3, 0.3)}
    body = palpate.Body(mesh, material=stiff)
    reference = skfem_stiffness(body)
    assert abs(body.stiffness() - reference).max() <= 1e-12 * abs(reference).max()


def test_rigid_motions_cost_nothing_and_mass_is_exact(block):
    K, nodes = block.stiffness(), block.mesh.nodes
    translations = [np.tile(axis, (len(nodes), 1)) for axis in np.eye(3)]
    rotations = [np.cross(axis, nodes) for axis in np.eye(3)]
    for motion in translations + rotations:
        force = K @ motion.ravel()
        assert np.abs(force).max() <= 1e-10 * abs(K).max() * np.abs(motion).max()
    for lumped in (False, True):
        u = translations[0].ravel()
        assert u @ (block.mass(lumped=lumped) @ u) == pytest.approx(1000 * block.mesh.volume, rel=1e-12)


def test_patch_test(tmp_path):
    """A linear displacement imposed on the whole boundary is reproduced inside: zero force there, constant stress."""
    mesh = box_mesh(seed=3)
    body = palpate.Body(mesh, material=palpate.Material(7e3, 0.35), fixed=lambda p: p[:, 0] < 1e-9)
    gradient = 1e-3 * RNG.normal(size=(3, 3))
    u = mesh.nodes @ gradient.T
    residual = (body.stiffness() @ u.ravel()).reshape(-1, 3)
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.surface_nodes)
    assert len(inside) > 5
    assert np.abs(residual[inside]).max() <= 1e-10 * np.abs(residual).max()

    green = palpate.precompute(body, precision="f64", path=tmp_path / "patch.palpate")
    answer = green.solve(displacements={int(n): u[n] for n in mesh.surface_nodes})
    scale = np.abs(residual).max()
    assert np.abs(answer.forces - residual[mesh.surface_nodes]).max() <= 1e-9 * scale
    # Total force on a face: sigma . n times its area.
    strain = (gradient + gradient.T) / 2
    lam, mu = 0.35 * 7e3 / (1.35 * 0.3), 7e3 / 2.7
    stress = lam * np.trace(strain) * np.eye(3) + 2 * mu * strain
    interior_force = answer.forces.sum(axis=0)
    assert np.abs(interior_force).max() <= 1e-10 * scale * len(mesh.nodes)
    moment = np.einsum("ni,nj->ij", answer.forces, mesh.nodes[mesh.surface_nodes])
    assert np.allclose(moment, stress * mesh.volume, rtol=0, atol=1e-9 * np.abs(stress).max() * mesh.volume)


@pytest.mark.parametrize("count", [1, 4, 25])
def test_prescribed_displacements_and_forces_equal_direct_solve(block, block_green, count):
    free = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)
    chosen = RNG.permutation(free)
    displacements = {int(n): 1e-3 * RNG.normal(size=3) for n in chosen[:count]}
    forces = {int(n): 0.01 * RNG.normal(size=3) for n in chosen[count : count + 5]}
    prescribed = dict.fromkeys(block.fixed_dofs.tolist(), 0.0)
    prescribed |= {3 * n + k: d[k] for n, d in displacements.items() for k in range(3)}
    loads = np.zeros(3 * len(block.mesh.nodes))
    for n, f in forces.items():
        loads[3 * n : 3 * n + 3] = f
    u, f = direct_solve(block, prescribed, loads)
    answer = block_green.solve(displacements=displacements, forces=forces)
    surface = block.mesh.surface_nodes
    assert relative(answer.displacements, u[surface]) <= 1e-9
    assert relative(answer.forces, f[surface]) <= 1e-9
    assert relative(answer.reactions, f[block.fixed_nodes]) <= 1e-9


def test_single_precision_store(block, tmp_path):
    green = palpate.precompute(block, precision="f32", path=tmp_path / "f32.palpate")
    free = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)
    chosen = [int(n) for n in free[:12]]
    K = skfem_stiffness(block)
    N = np.setdiff1d(np.arange(K.shape[0]), block.fixed_dofs)
    at = np.searchsorted(N, [3 * n + k for n in chosen for k in range(3)])
    C = np.linalg.inv(K[N][:, N].toarray())[np.ix_(at, at)]
    bound = max(1e-5, 0.1 * np.linalg.cond(C) * 2.0**-24)
    displacements = {n: 1e-3 * RNG.normal(size=3) for n in chosen}
    prescribed = dict.fromkeys(block.fixed_dofs.tolist(), 0.0)
    prescribed |= {3 * n + k: d[k] for n, d in displacements.items() for k in range(3)}
    u, f = direct_solve(block, prescribed, np.zeros(3 * len(block.mesh.nodes)))
    answer = green.solve(displacements=displacements)
    assert relative(answer.displacements, u[block.mesh.surface_nodes]) <= bound
    assert relative(answer.forces, f[block.mesh.surface_nodes]) <= bound


def test_single_components_moved_and_released_supports_equal_direct_solve(block, block_green):
    free = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)
    pushed, moved, released = (
        int(free[7]),
        int(block.fixed_nodes[0]),
        [int(n) for n in block.fixed_nodes[-2:]],
    )
    answer = block_green.solve(
        displacements={pushed: (None, 2e-3, None), moved: (1e-3, 0.0, -5e-4)},
        forces={released[0]: (0.02, 0.0, 0.01)},
        release=released,
    )
    gone = {3 * n + k for n in released for k in range(3)}
    prescribed = {d: 0.0 for d in block.fixed_dofs.tolist() if d not in gone}
    prescribed |= {3 * pushed + 1: 2e-3, 3 * moved: 1e-3, 3 * moved + 2: -5e-4}
    loads = np.zeros(3 * len(block.mesh.nodes))
    loads[3 * released[0] : 3 * released[0] + 3] = (0.02, 0.0, 0.01)
    u, f = direct_solve(block, prescribed, loads)
    surface = block.mesh.surface_nodes
    assert relative(answer.displacements, u[surface]) <= 1e-9
    assert relative(answer.forces, f[surface]) <= 1e-9
    assert relative(answer.reactions, f[block.fixed_nodes]) <= 1e-9


def test_supports_by_component_equal_direct_solve(tmp_path):
    mesh = box_mesh(cells=(3, 3, 3))
    fixed = np.zeros((len(mesh.nodes), 3), dtype=bool)
    for axis in range(3):
        fixed[mesh.nodes[:, axis] < 1e-9, axis] = True
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.3), fixed=fixed)
    green = palpate.precompute(body, precision="f64", path=tmp_path / "rollers.palpate")
    node = int(np.argmax(mesh.nodes.sum(axis=1)))
    prescribed = dict.fromkeys(body.fixed_dofs.tolist(), 0.0) | {
        3 * node: 1e-3,
        3 * node + 1: 0.0,
        3 * node + 2: 0.0,
    }
    u, f = direct_solve(body, prescribed, np.zeros(3 * len(mesh.nodes)))
    answer = green.solve(displacements={node: (1e-3, 0, 0)})
    assert relative(answer.displacements, u[mesh.surface_nodes]) <= 1e-9
    assert relative(answer.reactions, f[body.fixed_nodes]) <= 1e-9


def test_psi_is_symmetric(block, block_green):
    core, touch = block_green._core, np.searchsorted(block_green.surface_nodes, block_green.touchable_nodes)
    rows = np.repeat(3 * touch, 3) + np.tile([0, 1, 2], len(touch))
    dofs = np.repeat(3 * block_green.touchable_nodes, 3) + np.tile([0, 1, 2], len(touch))
    free = np.flatnonzero(~np.isin(dofs, block.fixed_dofs))[::7]
    psi = np.array([[core.entry(int(rows[i]), int(j)) for j in free] for i in free])
    assert np.abs(psi - psi.T).max() <= 1e-10 * np.abs(psi).max()


def test_point_touch_equals_prescribed_node(block, block_green):
    free = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)
    node = int(free[11])
    answer = block_green.solve(displacements={node: (1e-3, -2e-3, 5e-4)})
    touch = block_green.touch(point=block.mesh.nodes[node], displacement=(1e-3, -2e-3, 5e-4), radius=0.0)
    assert relative(touch.displacements, answer.displacements) <= 1e-9
    row = np.searchsorted(block.mesh.surface_nodes, node)
    assert relative(touch.force, answer.forces[row]) <= 1e-9


def test_patch_touch_moves_its_weighted_mean_and_converges_to_the_point(block, block_green):
    point = np.array([0.08, 0.021, 0.027])
    soft = block_green.touch(point=point, displacement=(-1e-3, None, None), radius=0.015)
    assert soft.force[0] < 0
    assert soft.force[1:] == pytest.approx(0, abs=1e-15)
    tiny = block_green.touch(point=point, displacement=(-1e-3, None, None), radius=1e-6)
    exact = block_green.touch(point=point, displacement=(-1e-3, None, None), radius=0.0)
    assert relative(tiny.force, exact.force) <= 1e-3
    assert abs(soft.force[0]) > abs(exact.force[0]) * 1.02


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"displacements": {10**6: (0, 0, 0)}}, "node 1000000 is not touchable"),
        ({"displacements": {0: (0, 0)}}, "node 0 needs three numbers, got 2"),
        ({"forces": {0: (0, np.nan, 0)}}, "node 0 has a number that is not finite"),
        ({"forces": {0: "abc"}}, "forces: node 0 needs three numbers"),
        ({"displacements": {0.5: (0, 0, 0)}}, "node 0.5 is not touchable"),
        ({"release": [10**6]}, "release: node 1000000 is not fixed"),
        ({"release": ["a"]}, "release: node a is not fixed"),
        ({"displacements": {79: (0, 0, 1e-3)}, "forces": {79: (0, 0, 1)}}, "node 79 has both .* along z"),
        ({"displacements": {0: (0, 0, 1e-3)}, "forces": {0: (0, 0, 1)}, "release": [0]}, "node 0 has both .* along z"),
    ],
)
def test_bad_boundary_changes_are_refused_by_name(block_green, arguments, message):
    with pytest.raises(palpate.Error, match=message):
        block_green.solve(**arguments)


def test_interior_release_and_free_release_are_refused(block, block_green, tmp_path):
    free = int(np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)[0])
    with pytest.raises(palpate.Error, match="not fixed"):
        block_green.solve(release=[free])
    inside = int(np.setdiff1d(np.arange(len(block.mesh.nodes)), block.mesh.surface_nodes)[0])
    body = palpate.Body(block.mesh, material=block.material, fixed=[inside, *block.fixed_nodes.tolist()])
    touch = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes[:1])
    green = palpate.precompute(body, touch=touch, path=tmp_path / "inside.palpate")
    with pytest.raises(palpate.BodyError, match=f"fixed node {inside} lies inside"):
        green.solve(release=[inside])
    with pytest.raises(palpate.BodyError, match="release: node 0 is not touchable"):
        green.solve(release=block.fixed_nodes[:1])


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_releases_that_leave_the_body_floating_are_refused(block, tmp_path, precision):
    """Two supported nodes leave a hinge, three do not; a prescribed displacement serves as a support."""
    green = palpate.precompute(block, precision=precision, path=tmp_path / "block.palpate")
    supported = block.fixed_nodes[[0, 3, 12]].tolist()
    push = {79: (0.0, 0.0, 0.01)}
    for kept in range(3):
        gone = [n for n in block.fixed_nodes.tolist() if n not in supported[:kept]]
        with pytest.raises(palpate.BodyError, match="leave the body, or a part of it, free to move"):
            green.solve(forces=push, release=gone)
    gone = [n for n in block.fixed_nodes.tolist() if n not in supported]
    answer = green.solve(forces=push, release=gone)
    prescribed = {3 * n + k: 0.0 for n in supported for k in range(3)}
    loads = np.zeros(3 * len(block.mesh.nodes))
    loads[3 * 79 + 2] = 0.01
    u, f = direct_solve(block, prescribed, loads)
    bound = 1e-9 if precision == "f64" else 1e-3
    assert relative(answer.displacements, u[block.mesh.surface_nodes]) <= bound
    assert relative(answer.reactions, f[block.fixed_nodes]) <= bound
    everything = green.solve(displacements={n: (0, 0, 0) for n in (79, 78, 64)}, release=block.fixed_nodes)
    assert np.abs(everything.displacements).max() <= 1e-12


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        (None, "no support"),
        ("all", "every node is fixed"),
        ([0], "rigid motions free"),
        ([10**6], "does not exist"),
    ],
)
def test_bodies_that_cannot_be_solved_are_refused(block, fixed, message):
    fixed = np.ones(len(block.mesh.nodes), dtype=bool) if fixed == "all" else fixed
    with pytest.raises(palpate.Error, match=message):
        palpate.precompute(palpate.Body(block.mesh, material=palpate.Material(1e4, 0.4), fixed=fixed))


def test_unattached_part_is_named():
    mesh = box_mesh(cells=(2, 2, 2))
    two = palpate.TetMesh(
        np.vstack([mesh.nodes, mesh.nodes + [1, 0, 0]]), np.vstack([mesh.tets, mesh.tets + len(mesh.nodes)])
    )
    body = palpate.Body(two, material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
    with pytest.raises(palpate.Error, match=rf"around node {len(mesh.nodes)} at \(1, 0, 0\) m has no support"):
        palpate.precompute(body)


@pytest.mark.parametrize(("e", "nu"), [(0, 0.3), (-1, 0.3), (1e4, 0.5), (1e4, -1.0), (float("nan"), 0.3)])
def test_impossible_materials_are_refused(e, nu):
    with pytest.raises(palpate.Error):
        palpate.Material(e, nu)


def test_locking_is_warned_of(block):
    with pytest.warns(palpate.LockingWarning, match=r"volumetric locking: 4-node .* ratio 0.46, above 0.45; 10-node"):
        palpate.Body(block.mesh, material=palpate.Material(1e4, 0.46))
    assert issubclass(palpate.LockingWarning, palpate.PalpateWarning)


def test_interior_displacements_equal_a_direct_solve(block, block_green):
    """The whole field under surface loads and a pressed node, from the surface alone, against SciPy's."""
    pressed, loaded = (int(n) for n in RNG.choice(np.setdiff1d(block_green.touchable_nodes, block.fixed_nodes), 2))
    answer = block_green.solve(displacements={pressed: (0, 0, -1e-3)}, forces={loaded: (0.1, -0.2, 0.3)})
    prescribed = {int(d): 0.0 for d in block.fixed_dofs} | {3 * pressed + k: v for k, v in enumerate((0, 0, -1e-3))}
    loads = np.zeros(3 * len(block.mesh.nodes))
    loads[3 * loaded : 3 * loaded + 3] = (0.1, -0.2, 0.3)
    u, _ = direct_solve(block, prescribed, loads)
    inside = np.setdiff1d(np.arange(len(block.mesh.nodes)), block.mesh.surface_nodes)
    assert len(inside) > 5
    assert relative(Interior(block).extend(answer.displacements), u) <= 1e-9


def test_interior_of_a_body_without_inner_nodes():
    """One tetrahedron: nothing is inside, the surface is the answer."""
    mesh = palpate.TetMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]))
    body = palpate.Body(mesh, material=palpate.Material(1e3, 0.3), fixed=[0, 1, 2])
    u = np.arange(12.0).reshape(4, 3)
    assert np.array_equal(Interior(body).extend(u), u)
    with pytest.raises(palpate.BodyError, match="finite"):
        Interior(body).extend(np.full((4, 3), np.nan))
