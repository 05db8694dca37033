"""Recovered stress and strain at surface nodes: exact where theory says so, converging to closed forms elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.fields import StressRecovery
from palpate.fields.stress import SAMPLES
from palpate.mesh.elements import EDGES
from palpate.mesh.shape_functions import tetrahedron_gradients

E, NU = 7e3, 0.35


def hooke(strain, e=E, nu=NU):
    lam, mu = nu * e / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    return lam * np.trace(strain) * np.eye(3) + 2 * mu * strain


def test_patch_test_is_exact_at_every_surface_node():
    mesh = box_mesh(cells=(4, 3, 3), jitter=0.25, seed=2)
    body = palpate.Body(mesh, material=palpate.Material(E, NU), fixed=lambda p: p[:, 0] < 1e-9)
    gradient = 1e-3 * np.random.default_rng(3).normal(size=(3, 3))
    field = StressRecovery(body).recover(mesh.nodes[mesh.surface_nodes] @ gradient.T)
    strain = (gradient + gradient.T) / 2
    stress = hooke(strain)
    assert np.abs(field.strain - strain).max() <= 1e-10 * np.abs(strain).max()
    assert np.abs(field.stress - stress).max() <= 1e-10 * np.abs(stress).max()
    principal = np.sort(np.linalg.eigvalsh(stress))[::-1]
    assert np.abs(field.principal_stresses - principal).max() <= 1e-9 * np.abs(principal).max()
    a, b, c = principal
    von_mises = np.sqrt(((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 2)
    assert field.von_mises == pytest.approx(von_mises, rel=1e-9)
    assert field.strain_magnitude == pytest.approx(np.linalg.norm(strain), rel=1e-9)
    assert field.principal_strains[:, 0] == pytest.approx(np.linalg.eigvalsh(strain).max(), rel=1e-9)


def test_rigid_motion_is_free_of_strain():
    mesh = box_mesh()
    body = palpate.Body(mesh, material=palpate.Material(E, NU), fixed=lambda p: p[:, 0] < 1e-9)
    x = mesh.nodes[mesh.surface_nodes]
    field = StressRecovery(body).recover(1e-3 * np.cross([1.0, -2.0, 0.5], x) + [1e-3, 0, 2e-3])
    assert field.strain_magnitude.max() <= 1e-14


def test_green_lagrange_strain_is_that_of_the_stretch_and_free_of_turning():
    """`F = R U` has the strain `(U^2 - 1) / 2`, whatever the turn `R`; the infinitesimal one is far from it."""
    mesh = box_mesh(cells=(3, 3, 3), jitter=0.25, seed=4)
    body = palpate.Body(mesh, material=palpate.Material(E, NU), fixed=lambda p: p[:, 0] < 1e-9)
    stretch = np.diag([1.3, 0.9, 0.8])
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    positions = mesh.nodes[mesh.surface_nodes]
    field = StressRecovery(body).recover(positions @ (turn @ stretch).T - positions)
    expected = (stretch @ stretch - np.eye(3)) / 2
    assert np.abs(field.green_lagrange_strain - expected).max() < 1e-9
    assert np.abs(field.strain - expected).max() > 0.2


def test_materials_in_series_carry_the_same_stress():
    """A bar with nu = 0 of two materials in tension: one stress everywhere, to the last node beside the joint."""
    mesh = box_mesh(cells=(3, 3, 8), size=(0.02, 0.02, 0.08), jitter=0)
    mesh = mesh.with_regions({"stiff": palpate.shapes.HalfSpace((0, 0, 0.03), (0, 0, 1))})
    rollers = np.zeros((len(mesh.nodes), 3), dtype=bool)
    for axis in range(3):
        rollers[mesh.nodes[:, axis] < 1e-9, axis] = True
    pull = palpate.Loads(pressure=[(lambda p: p[:, 2] > 0.08 - 1e-9, -200.0)])
    materials = {0: palpate.Material(1e3, 0.0), "stiff": palpate.Material(9e3, 0.0)}
    body = palpate.Body(mesh, material=materials, fixed=rollers, loads=pull)
    green = palpate.precompute(body, precision="f64", touch=[0])
    field = StressRecovery(body).recover(green.free_displacements)
    expected = np.zeros((3, 3))
    expected[2, 2] = 200.0
    assert np.abs(field.stress - expected).max() <= 1e-8 * 200
    z = mesh.nodes[mesh.surface_nodes, 2]
    assert field.strain[z < 0.03 - 1e-9, 2, 2] == pytest.approx(200 / 9e3, rel=1e-8)
    assert field.strain[z > 0.03 + 1e-9, 2, 2] == pytest.approx(200 / 1e3, rel=1e-8)


def thick_cylinder(cells, inner=0.02, outer=0.04, pressure=1e3, nu=0.3):
    """Quarter of a long cylinder under internal pressure: recovered and exact stress at its surface nodes."""
    quarter = box_mesh(cells, (outer - inner, np.pi / 2, 0.01), jitter=0.1)
    r, angle = quarter.nodes[:, 0] + inner, quarter.nodes[:, 1]
    nodes = np.column_stack([r * np.cos(angle), r * np.sin(angle), quarter.nodes[:, 2]])
    mesh = palpate.TetMesh(nodes, quarter.tets)
    rollers = np.abs(nodes) < 1e-9
    rollers[:, 2] |= nodes[:, 2] > 0.01 - 1e-9  # plane strain
    loads = palpate.Loads(pressure=[(lambda p: np.hypot(p[:, 0], p[:, 1]) < inner + 1e-6, pressure)])
    body = palpate.Body(mesh, material=palpate.Material(1e4, nu), fixed=rollers, loads=loads)
    green = palpate.precompute(body, precision="f64", touch=mesh.surface_nodes[:1])
    field = StressRecovery(body).recover(green.free_displacements)

    x = mesh.nodes[mesh.surface_nodes]
    r = np.hypot(x[:, 0], x[:, 1])
    radial = np.column_stack([x[:, 0] / r, x[:, 1] / r, 0 * r])
    hoop = np.column_stack([-radial[:, 1], radial[:, 0], 0 * r])
    scale = pressure * inner**2 / (outer**2 - inner**2)
    exact = scale * np.column_stack([1 - outer**2 / r**2, 1 + outer**2 / r**2, np.full(len(r), 2 * nu)])
    axes = (radial, hoop, np.tile([0.0, 0.0, 1.0], (len(r), 1)))
    found = np.column_stack([np.einsum("ni,nij,nj->n", a, field.stress, a) for a in axes])
    return found, exact, r


def test_thick_cylinder_converges_to_lame():
    errors = []
    for n in (1, 2, 3):
        found, exact, r = thick_cylinder((4 * n, 8 * n, 2 * n))
        errors.append(np.sqrt(((found - exact) ** 2).mean(axis=0)).max() / exact.max())
    assert errors[2] < 0.03
    assert errors[0] > 2 * errors[1]  # faster than the elements' own O(h) at the boundary
    assert found[r < 0.02 + 1e-6, 1].mean() == pytest.approx(exact[:, 1].max(), rel=0.03)


def test_quadratic_elements_differentiate_quadratic_fields_exactly():
    rng = np.random.default_rng(5)
    corners = np.eye(4, 3) + 0.2 * rng.normal(size=(4, 3))
    nodes = np.vstack([corners, corners[EDGES].mean(axis=1)])
    A, b = rng.normal(size=(3, 3)), rng.normal(size=3)
    A = A + A.T
    values = np.einsum("ni,ij,nj->n", nodes, A, nodes) / 2 + nodes @ b
    points = SAMPLES[10]
    gradients = tetrahedron_gradients(nodes, np.arange(10)[None], points)[0]
    assert np.einsum("pnx,n->px", gradients, values) == pytest.approx(points @ corners @ A + b, abs=1e-12)
    # The four points with equal weights integrate quadratics over a tetrahedron: int L_i^2 dV = V / 10.
    assert (points**2).mean(axis=0) == pytest.approx(0.1, abs=1e-15)


def test_simulation_reports_the_stress_under_the_finger(tmp_path):
    box_mesh(cells=(6, 4, 4)).write(tmp_path / "block.vtu")
    (tmp_path / "a.toml").write_text('[body]\nmesh = "block.vtu"\n[supports]\nfixed = "z < 1e-6"\n')
    with palpate.Simulation(palpate.Scene.read(tmp_path / "a.toml")) as simulation:
        green = simulation.green
        touch = green.touch((0.04, 0.025, 0.05), (0, 0, -2e-3), 0.012)
        field = simulation.stress(touch.displacements)
        under = np.argmin(np.linalg.norm(green.surface_positions - [0.04, 0.025, 0.05], axis=1))
        assert field.stress[under, 2, 2] < -100
        assert field.von_mises.shape == (len(green.surface_nodes),)
        simulation.set_youngs_modulus(2 * green.youngs_modulus)
        stiffer = simulation.stress(touch.displacements)
        assert stiffer.stress == pytest.approx(2 * field.stress)
        assert np.array_equal(stiffer.strain, field.strain)
    green.save(tmp_path / "a.palpate")
    store = palpate.Simulation(palpate.Scene.of_store(tmp_path / "a.palpate"))
    with pytest.raises(palpate.SceneError, match="knows only its surface"):
        store.stress(touch.displacements)
