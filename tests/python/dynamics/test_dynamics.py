"""Newmark's scheme against theory, SciPy, and itself in other forms."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg
from conftest import box_mesh, skfem_mass, skfem_stiffness

import palpate
from palpate.dynamics import newmark

SCHEMES = [(0.25, 0.5), (0.3025, 0.6), (1 / 6, 0.5), (0.0, 0.5), (0.1, 0.7)]


@pytest.fixture(scope="module")
def spring() -> palpate.Body:
    """One tetrahedron with a single free dof."""
    mesh = palpate.TetMesh(
        np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], float), np.array([[0, 1, 2, 3]])
    )
    mask = np.ones((4, 3), dtype=bool)
    mask[3, 2] = False
    return palpate.Body(mesh, material=palpate.Material(10e3, 0.3), fixed=mask)


@pytest.fixture(scope="module")
def small() -> palpate.Body:
    return palpate.Body(box_mesh((3, 2, 2)), material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 0] < 1e-9)


def matrices(body, mass="consistent"):
    """Dense stiffness and mass of the free dofs, and their numbers."""
    free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
    keep = np.ix_(free, free)
    return body.stiffness().toarray()[keep], body.mass(lumped=mass == "lumped").toarray()[keep], free


def corner(body):
    """The free node farthest from the origin."""
    return int(np.argmax(body.mesh.nodes.sum(axis=1)))


def angular_frequency(body):
    k, m, _ = matrices(body)
    return float(np.sqrt(k[0, 0] / m[0, 0]))


# --- one degree of freedom: theory ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("alpha", "delta"), SCHEMES[:3])
def test_period_and_numerical_damping_of_one_dof_are_those_of_theory(spring, alpha, delta):
    step_angle = 0.1
    dt = step_angle / angular_frequency(spring)
    start = np.zeros((4, 3))
    start[3, 2] = 1e-3
    motion = palpate.Newmark(spring, dt, alpha, delta, method="sparse", displacements=start)
    u = motion.play([3], np.zeros((60, 1, 3)))[:, 0, 2]
    # u_(n+1) = trace u_n - determinant u_(n-1): the eigenvalues of the step.
    trace, determinant = np.linalg.lstsq(np.column_stack([u[1:-1], -u[:-2]]), u[2:], rcond=None)[0]
    angle = np.arccos(trace / (2 * np.sqrt(determinant)))
    e = delta - 0.5
    elongation = step_angle**2 / 2 * (alpha - 1 / 12 - e / 2 + e**2 / 4)
    assert step_angle / angle - 1 == pytest.approx(elongation, rel=0.02)
    damping = -0.5 * np.log(determinant) / angle
    assert damping == pytest.approx(e * step_angle / 2, rel=0.02, abs=1e-9)


def test_rayleigh_damping_gives_the_ratio_asked_for(spring):
    w = angular_frequency(spring)
    f = w / (2 * np.pi)
    a, b = palpate.rayleigh_from_ratios(0.04, f, 0.1, 7 * f)
    for w_i, xi in ((w, 0.04), (7 * w, 0.1)):
        assert a / (2 * w_i) + b * w_i / 2 == pytest.approx(xi)
    start = np.zeros((4, 3))
    start[3, 2] = 1e-3
    motion = palpate.Newmark(spring, 0.01 / w, rayleigh=(a, b), method="sparse", displacements=start)
    u = motion.play([3], np.zeros((4000, 1, 3)))[:, 0, 2]
    peaks = [u[i] for i in range(1, len(u) - 1) if u[i - 1] < u[i] >= u[i + 1]]
    decrement = np.log(peaks[0] / peaks[4]) / 4
    assert decrement == pytest.approx(2 * np.pi * 0.04 / np.sqrt(1 - 0.04**2), rel=1e-3)


@pytest.mark.parametrize("bad", [(0.1, 1, 0.1, 1), (0.1, 0, 0.1, 1), (-0.1, 1, 0.1, 2), (0.01, 1, 0.9, 2)])
def test_ratios_that_make_no_sense_are_refused(bad):
    with pytest.raises(palpate.BodyError):
        palpate.rayleigh_from_ratios(*bad)


# --- stability -----------------------------------------------------------------------------------------------------


def spectral_radius(k, c, dt, alpha, delta):
    """Largest eigenvalue of the step of (u, v, a) of one mode, from the scheme's definition."""
    left = np.array([[1, 0, -alpha * dt**2], [0, 1, -delta * dt], [k, c, 1]])
    right = np.array([[1, dt, (0.5 - alpha) * dt**2], [0, 1, (1 - delta) * dt], [0, 0, 0]])
    return np.abs(np.linalg.eigvals(np.linalg.solve(left, right))).max()


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize(
    ("alpha", "delta", "rayleigh"),
    [(0.0, 0.5, (0, 0)), (1 / 6, 0.5, (0, 0)), (0.0, 0.5, (5.0, 1e-4)), (0.1, 0.7, (5.0, 2e-4))],
)
def test_stability_limit_is_that_found_by_bisection(small, mass, alpha, delta, rayleigh):
    k, m, _ = matrices(small, mass)
    eigenvalues = scipy.linalg.eigvalsh(k, m)
    low, high = 1e-6, 1.0
    while high / low > 1.0001:
        dt = np.sqrt(low * high)
        radii = [spectral_radius(w2, rayleigh[0] + rayleigh[1] * w2, dt, alpha, delta) for w2 in eigenvalues[[0, -1]]]
        low, high = (dt, high) if max(radii) <= 1 + 1e-7 else (low, dt)
    settings = {"rayleigh": rayleigh, "mass": mass, "method": "sparse"}
    motion = palpate.Newmark(small, 0.99 * low, alpha, delta, **settings)
    assert motion.largest_stable_dt == pytest.approx(low, rel=0.01)
    motion.step({corner(small): (0.1, 0, 0.1)})
    motion.step(count=3000)
    assert np.abs(motion.displacements).max() < 1.0
    with pytest.raises(palpate.BodyError, match=r"largest stable dt is .* s .omega_max = "):
        palpate.Newmark(small, 1.01 * low, alpha, delta, **settings)
    with pytest.raises(palpate.BodyError, match="largest stable dt"):
        palpate.Newmark(small, 1.01 * low, alpha, delta, **{**settings, "method": "modal"})


def test_unconditional_schemes_take_any_step(small):
    assert palpate.Newmark(small, 10.0, method="sparse").largest_stable_dt == np.inf


# --- energy --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "steps"), [("modal", 100_000), ("sparse", 20_000)])
def test_average_acceleration_keeps_energy(small, method, steps):
    motion = palpate.Newmark(small, method=method)
    motion.step({corner(small): (0.05, -0.02, 0.1)}, 40)
    motion.step()
    before = motion.energy
    assert before.total == pytest.approx(before.work, rel=1e-12)
    motion.step(count=steps)
    after = motion.energy
    assert after.total == pytest.approx(before.total, rel=1e-9)
    assert after.kinetic != pytest.approx(before.kinetic, rel=1e-3)


@pytest.mark.parametrize("method", ["modal", "dense"])
def test_what_damping_takes_is_booked(small, method):
    motion = palpate.Newmark(small, rayleigh=(1.0, 2e-4), method=method)
    motion.step({corner(small): (0.05, -0.02, 0.1)}, 300)
    energy = motion.energy
    assert energy.total + energy.dissipated == pytest.approx(energy.work, rel=1e-10)
    assert 0.1 * energy.work < energy.dissipated < energy.work


# --- all methods agree ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("rayleigh", [(0.0, 0.0), (2.0, 1e-4)])
@pytest.mark.parametrize(("alpha", "delta"), SCHEMES)
def test_modal_sparse_and_dense_are_one_motion(small, alpha, delta, rayleigh, mass):
    dt = 1e-3 if 2 * alpha >= delta else 3e-4
    seen = {}
    for method in ("modal", "sparse", "dense"):
        motion = palpate.Newmark(small, dt, alpha, delta, rayleigh, mass, method)
        for i in range(20):
            motion.step({corner(small): (0.01 * i, 0.1, -0.1)}, 5)
        motion.step(count=9900)
        motion.step({corner(small): (0.1, 0.0, -0.1)})
        assert motion.time == pytest.approx(10_001 * dt)
        seen[method] = (motion.displacements, motion.velocities, motion.accelerations)
    for method in ("modal", "dense"):
        for ours, direct in zip(seen[method], seen["sparse"], strict=True):
            assert np.abs(ours - direct).max() < 1e-9 * np.abs(direct).max()


def test_one_step_is_the_corrected_equation_and_no_printed_term_is_right(small):
    """The equation of motion after a step of equation 4.4: right as corrected, wrong with any printed term."""
    alpha, delta, dt, (a, b) = 0.3, 0.6, 1e-3, (3.0, 2e-4)
    k, m, free = matrices(small)
    damping = a * m + b * k
    rng = np.random.default_rng(3)
    u0, v0, force = 1e-3 * rng.normal(size=len(free)), rng.normal(size=len(free)), rng.normal(size=len(free))
    a0 = np.linalg.solve(m, -damping @ v0 - k @ u0)
    right = {"mass": 1 / (2 * alpha) - 1, "velocity": delta / alpha - 1, "acceleration": dt * (delta / (2 * alpha) - 1)}
    printed = {
        "mass": (1 - alpha) / 2,
        "velocity": (delta - 1) / alpha,
        "acceleration": 1 - delta + (1 - alpha) * dt * delta / 2,
    }

    def new_displacement(terms):
        effective = m / (alpha * dt**2) + damping * delta / (alpha * dt) + k
        inertia = m @ (u0 / (alpha * dt**2) + v0 / (alpha * dt) + terms["mass"] * a0)
        resisting = delta / (alpha * dt) * u0 + terms["velocity"] * v0 + terms["acceleration"] * a0
        return np.linalg.solve(effective, force + inertia + damping @ resisting)

    def residual_of_motion(u1):
        a1 = (u1 - u0 - dt * v0) / (alpha * dt**2) - (1 / (2 * alpha) - 1) * a0
        v1 = v0 + dt * ((1 - delta) * a0 + delta * a1)
        return np.linalg.norm(m @ a1 + damping @ v1 + k @ u1 - force) / np.linalg.norm(m @ a1)

    assert residual_of_motion(new_displacement(right)) < 1e-9
    for term in right:
        assert residual_of_motion(new_displacement({**right, term: printed[term]})) > 1e-2, term
    start = np.zeros((2, 3 * len(small.mesh.nodes)))
    start[:, free] = u0, v0
    u, v = start.reshape(2, -1, 3)
    history = np.zeros(start.shape[1])
    history[free] = force
    everywhere = np.arange(len(small.mesh.nodes))
    for method in ("sparse", "dense", "modal"):
        motion = palpate.Newmark(small, dt, alpha, delta, (a, b), method=method, displacements=u, velocities=v)
        moved = motion.play(everywhere, history.reshape(1, -1, 3))
        assert moved.ravel()[free] == pytest.approx(new_displacement(right), rel=1e-9, abs=1e-13)


# --- SciPy ---------------------------------------------------------------------------------------------------------


def exact_motion(body, rayleigh, start_velocity, time):
    """Displacements and velocities of the free dofs by the matrix exponential."""
    k, m, free = matrices(body)
    size = len(free)
    stiffness, damping = np.linalg.solve(m, k), np.linalg.solve(m, rayleigh[0] * m + rayleigh[1] * k)
    system = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -damping]])
    return scipy.linalg.expm(time * system) @ np.concatenate([np.zeros(size), start_velocity[free]])


def smooth_velocity(body):
    velocity = np.zeros_like(body.mesh.nodes)
    velocity[:, 2] = 4.0 * body.mesh.nodes[:, 0] ** 2
    return np.where(body.fixed_mask, 0.0, velocity)


def test_error_against_the_matrix_exponential_is_of_second_order(small):
    rayleigh, time = (1.0, 5e-4), 0.05
    velocity = smooth_velocity(small)
    free = matrices(small)[2]
    exact = exact_motion(small, rayleigh, velocity.ravel(), time)[: len(free)]
    errors = []
    for steps in (100, 200, 400):
        motion = palpate.Newmark(small, time / steps, rayleigh=rayleigh, method="sparse", velocities=velocity)
        motion.step(count=steps)
        errors.append(np.abs(motion.displacements.ravel()[free] - exact).max() / np.abs(exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[0] < 0.05
    assert orders == pytest.approx([2.0, 2.0], abs=0.15)


def test_exponential_method_is_exact(small):
    velocity = smooth_velocity(small)
    free = matrices(small)[2]
    exact = exact_motion(small, (1.0, 5e-4), velocity.ravel(), 0.05)
    motion = palpate.Newmark(small, 0.01, rayleigh=(1.0, 5e-4), method="exponential", velocities=velocity)
    motion.step(count=5)
    for ours, theirs in ((motion.displacements, exact[: len(free)]), (motion.velocities, exact[len(free) :])):
        assert np.abs(ours.ravel()[free] - theirs).max() < 1e-9 * np.abs(theirs).max()
    # Under a ramp too: Newmark's steps, a hundred times smaller, come near.
    fine = palpate.Newmark(small, 1e-4, rayleigh=(1.0, 5e-4), velocities=velocity)
    fine.step(count=500)
    ramp = np.linspace(0, 1, 101)[1:, None, None] * [0.0, 0.0, 0.1]
    fine.play([corner(small)], ramp)
    motion.step({corner(small): (0, 0, 0.1)})
    assert np.abs(motion.displacements - fine.displacements).max() < 2e-4 * np.abs(fine.displacements).max()


def test_released_body_swings_at_its_first_frequency(small):
    """The frequency is taken from scikit-fem's matrices."""
    free = matrices(small)[2]
    k, m = (x[free][:, free].toarray() for x in (skfem_stiffness(small), skfem_mass(small)))
    eigenvalues, shapes = scipy.linalg.eigh(k, m)
    pressed = np.zeros(3 * len(small.mesh.nodes))
    pressed[free] = 1e-2 * shapes[:, 0]
    motion = palpate.Newmark(small, 1e-4, displacements=pressed.reshape(-1, 3))
    u = motion.play([corner(small)], np.zeros((20_000, 1, 3)))[:, 0]
    u = u[:, np.argmax(np.abs(u[0]))]
    rising = np.flatnonzero((u[:-1] < 0) & (u[1:] >= 0))
    crossings = rising + u[rising] / (u[rising] - u[rising + 1])
    period = np.diff(crossings).mean() * 1e-4
    assert 1 / period == pytest.approx(np.sqrt(eigenvalues[0]) / (2 * np.pi), rel=1e-4)


# --- truncated bases -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def medium() -> palpate.Body:
    return palpate.Body(box_mesh((6, 4, 4)), material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 0] < 1e-9)


@pytest.mark.parametrize("count", [1, 20, 200])
def test_a_held_press_ends_at_the_static_solution_for_any_number_of_modes(medium, count):
    node = corner(medium)
    motion = palpate.Newmark(medium, 2e-3, rayleigh=(60.0, 2e-3), modes=count)
    motion.step({node: (0.01, 0.02, -0.03)}, 4000)
    k, _, free = matrices(medium)
    force = np.zeros(3 * len(medium.mesh.nodes))
    force[3 * node : 3 * node + 3] = 0.01, 0.02, -0.03
    static = np.linalg.solve(k, force[free])
    assert np.abs(motion.displacements.ravel()[free] - static).max() < 1e-9 * np.abs(static).max()
    assert motion.energy.strain == pytest.approx(0.5 * force[free] @ static, rel=1e-9)
    assert np.abs(motion.velocities).max() < 1e-12


def test_truncation_without_correction_would_not(medium, monkeypatch):
    monkeypatch.setattr(newmark.Residual, "answer", lambda _self, forces: np.zeros_like(forces))
    node = corner(medium)
    motion = palpate.Newmark(medium, 2e-3, rayleigh=(60.0, 2e-3), modes=20)
    motion.step({node: (0.0, 0.0, -0.03)}, 4000)
    full = palpate.Newmark(medium, 2e-3, rayleigh=(60.0, 2e-3), method="sparse")
    full.step({node: (0.0, 0.0, -0.03)}, 4000)
    assert np.abs(motion.displacements[node] - full.displacements[node]).max() > 0.05 * np.abs(full.displacements).max()


def test_low_motion_of_a_truncated_basis_is_that_of_the_body(medium):
    node = corner(medium)
    time = np.arange(1, 2001) * 1e-3
    history = 0.02 * np.sin(2 * np.pi * 1.5 * time)[:, None, None] * [0.0, 0.3, 1.0]
    seen = [
        palpate.Newmark(medium, rayleigh=(3.0, 1e-3), **how).play([node], history, [node, 3])
        for how in ({"modes": 40}, {"method": "sparse"})
    ]
    assert np.abs(seen[0] - seen[1]).max() < 5e-3 * np.abs(seen[1]).max()


def test_free_body_flies_as_a_rigid_one_and_bends_as_the_full_one():
    body = palpate.Body(box_mesh((4, 3, 3)), material=palpate.Material(10e3, 0.4))
    node, force = corner(body), np.array([0.02, -0.01, 0.03])
    total = body.mass().sum() / 3
    seen = []
    for how in ({"modes": 20}, {"method": "sparse"}, {}):
        motion = palpate.Newmark(body, rayleigh=(0.0, 5e-3), **how)
        motion.step({node: force}, 1000)
        momentum = (body.mass() @ motion.velocities.ravel()).reshape(-1, 3).sum(axis=0)
        # F grows from zero within the first step: half of it counts.
        assert momentum == pytest.approx(force * (1000 - 0.5) * 1e-3, rel=1e-9)
        seen.append(motion.displacements)
    assert np.abs(seen[2] - seen[1]).max() < 1e-9 * np.abs(seen[1]).max()
    drift = (body.mass() @ seen[1].ravel()).reshape(-1, 3).sum(axis=0) / total
    static = np.abs(seen[1] - drift).max()
    assert np.abs(seen[0] - seen[1]).max() < 1e-6 * static
    # A free body has six: round-off alone must not let fewer pass.
    for count in range(1, 6):
        with pytest.raises(palpate.BodyError, match="rigid motions"):
            palpate.Newmark(body, modes=count)
    palpate.Newmark(body, modes=6)


# --- arguments -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("modes", [None, 15])
def test_play_is_a_sequence_of_steps(small, modes):
    node, other = corner(small), 2
    history = np.random.default_rng(0).normal(size=(50, 2, 3))
    played, stepped = (palpate.Newmark(small, modes=modes) for _ in range(2))
    seen = played.play([node, other], history, [node])
    for i, forces in enumerate(history):
        stepped.step({node: forces[0], other: forces[1]})
        assert seen[i, 0] == pytest.approx(stepped.displacements[node], rel=1e-9)
    assert played.displacements == pytest.approx(stepped.displacements, rel=1e-12)
    again = palpate.Newmark(small, modes=modes).play([node, other], history, [node])
    assert np.array_equal(again, seen), "the same input must give the same bits"


def test_forces_on_supports_go_into_them(small):
    motion = palpate.Newmark(small)
    motion.step({int(small.fixed_nodes[0]): (1.0, 2.0, 3.0)}, 10)
    assert not motion.displacements.any()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"method": "euler"}, "method"),
        ({"mass": "heavy"}, "consistent"),
        ({"dt": 0.0}, "time step"),
        ({"dt": np.nan}, "time step"),
        ({"alpha": -0.1}, "alpha"),
        ({"delta": 0.4}, "adds energy"),
        ({"rayleigh": (-1.0, 0.0)}, "Rayleigh"),
        ({"method": "sparse", "modes": 3}, "modes"),
        ({"modes": 0}, "modes"),
        ({"velocities": np.zeros((2, 3))}, "velocities"),
    ],
)
def test_settings_that_make_no_sense_are_refused(small, settings, words):
    with pytest.raises(palpate.BodyError, match=words):
        palpate.Newmark(small, **settings)


@pytest.mark.parametrize("forces", [{-1: (0, 0, 1)}, {10**6: (0, 0, 1)}, {0: (0, 0)}, {0: (0, 0, np.inf)}, {0: "abc"}])
def test_forces_that_make_no_sense_are_refused(small, forces):
    motion = palpate.Newmark(small, method="sparse")
    with pytest.raises(palpate.BodyError, match="node"):
        motion.step(forces)
    assert motion.time == 0.0


def test_a_body_without_mass_is_refused(small):
    weightless = palpate.Body(small.mesh, material=palpate.Material(1e4, 0.4, 0.0), fixed=small.fixed_nodes)
    with pytest.raises(palpate.BodyError, match="density"):
        palpate.Newmark(weightless)
