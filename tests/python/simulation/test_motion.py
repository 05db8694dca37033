"""Contacts on a body that moves: pressed, struck and let go, against static answers, natural frequencies and energy."""

from __future__ import annotations

import time

import numpy as np
import pytest
import scipy.linalg
from conftest import box_mesh, skfem_stiffness

import palpate

SIZE = (0.12, 0.03, 0.03)
RADIUS, CONTACT_RADIUS, COUPLING = 0.006, 0.008, 500.0
TOP = np.array([0.10, 0.015, 0.03])
FREE_LIMITS = "[device]\nmax_force = '1kN'\nmax_slew = 1e9\nramp = 0\n[view]\nstrain_limit = 0\n"


def scene(folder, dynamics: str, fixed: str = "x < 1e-6", more: str = "", cells=(10, 3, 3)) -> palpate.Scene:
    """Scene of a bar of soft rubber, a cantilever unless it is fixed elsewhere; ``more`` goes behind [body]."""
    box_mesh(cells=cells, size=SIZE, jitter=0).write(folder / "beam.vtu")
    text = (
        f"[body]\nmesh = 'beam.vtu'\nprecision = 'f64'\n{more}"
        "[material]\nyoungs_modulus = '50kPa'\npoissons_ratio = 0.4\ndensity = 1000\n"
        f"[supports]\nfixed = '{fixed}'\n"
        f"[tool]\nradius = {RADIUS}\ncontact_radius = {CONTACT_RADIUS}\n"
        f"{FREE_LIMITS}[dynamics]\ncoupling = {COUPLING}\n{dynamics}"
    )
    (folder / "beam.toml").write_text(text)
    return palpate.Scene.read(folder / "beam.toml")


def approach_and_hold(depth: float, ticks: int, speed: float = 0.1) -> np.ndarray:
    """Tool positions: down at a speed from 1 mm above, resting when it is so deep."""
    depths = np.minimum(speed * 1e-3 * np.arange(ticks), 1e-3 + depth) - 1e-3
    return TOP + np.array([0, 0, RADIUS]) - np.outer(depths, [0, 0, 1])


def static_force(green: palpate.GreensFunction, displacement: np.ndarray) -> np.ndarray:
    """Force on the device of the body at rest, pushed through the coupling."""
    stiffness = np.column_stack([green.touch(TOP, unit, CONTACT_RADIUS).force for unit in np.eye(3)])
    return -np.linalg.solve(np.linalg.inv(stiffness) + np.eye(3) / COUPLING, displacement)


@pytest.mark.parametrize("weights", ["", "delta = 0.5\nalpha = 0.25\n", "scheme = 'exact'\n"])
@pytest.mark.parametrize("modes", ["'all'", "1", "20", "200"])
def test_a_held_press_comes_to_the_static_answer(tmp_path, weights, modes):
    """On a bar lying on a table; a cantilever would bounce off the tool that stops, and stick to it elsewhere."""
    simulation = palpate.Simulation(scene(tmp_path, f"modes = {modes}\n{weights}", fixed="z < 1e-6"))
    forces = simulation.run(approach_and_hold(0.003, 12_000))
    expected = static_force(simulation.green, np.array([0, 0, -0.003]))
    assert forces[-1] == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.linalg.norm(expected))
    # The force must not alternate from tick to tick.
    assert np.abs(np.diff(forces[-100:], axis=0)).max() < 1e-3 * np.linalg.norm(expected)


def test_a_held_press_is_the_body_with_the_spring_built_in(tmp_path):
    """Newmark in accelerations for `K + k_c W W^T` under `k_c W d`; the spring itself is not damped."""
    built = scene(tmp_path, "modes = 'all'\nrayleigh = [1.0, 2e-4]\n", fixed="z < 1e-6")
    built = built.model_copy(update={"tools": [built.tools[0].model_copy(update={"contact_radius": 0.0})]})
    simulation = palpate.Simulation(built)
    body = simulation.body
    # Without a radius a contact carries the shape functions at the point: here of two corners of a triangle.
    nodes = [
        int(np.argmin(np.linalg.norm(body.mesh.nodes - corner, axis=1)))
        for corner in ([0.048, 0.01, 0.03], [0.06, 0.01, 0.03])
    ]
    at = 0.7 * body.mesh.nodes[nodes[0]] + 0.3 * body.mesh.nodes[nodes[1]]
    # Straight down where it touches, sideways later: the displacement along the surface counts from the first touch.
    path = 1e-3 * np.minimum(1.0, 0.01 * np.arange(400))[:, None] * [0.0, 0.0, -1.0]
    path[20:, :2] = 1e-4 * np.sin(0.05 * np.arange(380))[:, None] * [2.0, 1.0]
    forces = simulation.run(at + [0, 0, RADIUS] + path)
    free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
    patch = np.zeros((3 * len(body.mesh.nodes), 3))
    for node, weight in zip(nodes, (0.7, 0.3), strict=True):
        patch[3 * node : 3 * node + 3] = weight * np.eye(3)
    patch = patch[free]
    K, M = (m.tocsc()[free][:, free].toarray() for m in (skfem_stiffness(body), body.mass()))
    dt, delta, damping, stiff = 1e-3, 0.6, M + 2e-4 * K, K + COUPLING * patch @ patch.T
    alpha = (delta + 0.5) ** 2 / 4
    inverse = np.linalg.inv(M + delta * dt * damping + alpha * dt**2 * stiff)
    u, v, a = np.zeros((3, len(free)))
    for target, force in zip(path, forces, strict=True):
        u, v = u + dt * v + dt**2 * (0.5 - alpha) * a, v + dt * (1 - delta) * a
        a = inverse @ (COUPLING * patch @ target - damping @ v - stiff @ u)
        u, v = u + alpha * dt**2 * a, v + delta * dt * a
        assert force == pytest.approx(-COUPLING * (target - patch.T @ u), rel=1e-6, abs=1e-9)


def test_a_held_press_on_a_single_precision_store(tmp_path):
    scene(tmp_path, "modes = 20\n", fixed="z < 1e-6")
    (tmp_path / "beam.toml").write_text((tmp_path / "beam.toml").read_text().replace("'f64'", "'f32'"))
    simulation = palpate.Simulation(palpate.Scene.read(tmp_path / "beam.toml"))
    assert simulation.green.precision == "f32"
    force = simulation.run(approach_and_hold(0.003, 12_000))[-1]
    expected = static_force(simulation.green, np.array([0, 0, -0.003]))
    assert force == pytest.approx(expected, rel=1e-5, abs=1e-5 * np.linalg.norm(expected))


def test_a_held_press_on_quadratic_elements_comes_to_the_static_answer(tmp_path):
    built = scene(tmp_path, "modes = 60\n", fixed="z < 1e-6", more="element = 'quadratic'\n", cells=(6, 2, 2))
    simulation = palpate.Simulation(built)
    assert simulation.body.mesh.is_quadratic
    forces = simulation.run(approach_and_hold(0.003, 12_000))
    expected = static_force(simulation.green, np.array([0, 0, -0.003]))
    assert forces[-1] == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.linalg.norm(expected))


def test_a_body_in_motion_sags_under_its_weight_and_moves_about_that(tmp_path):
    """At rest a touch is that of the sagged body at rest; a strike swings about that state, and dies down to it."""
    weight = "[[loads]]\ngravity = [0, 0, -9.81]\n"
    simulation = palpate.Simulation(scene(tmp_path, "modes = 40\n", more=weight))
    sag = simulation.green.free_displacements
    top = int(np.argmin(np.linalg.norm(simulation.green.surface_positions - [0.108, 0.02, 0.03], axis=1)))
    node = int(simulation.green.surface_nodes[top])
    away = np.full((8000, 3), np.nan)
    played = simulation.play(away, strikes=[(100, TOP, (0, 0, -1e-3))], watch=[node])
    heights = played.displacements[:, 0]
    assert heights[:100] == pytest.approx(np.tile(sag[top], (100, 1)), rel=1e-12)
    assert np.ptp(heights[200:1000, 2]) > 1e-3
    assert heights[-1] == pytest.approx(sag[top], abs=1e-6)
    # On a table the press counts from the sagged surface, and ends at the answer of the sagged body at rest.
    lying = palpate.Simulation(scene(tmp_path, "modes = 40\n", fixed="z < 1e-6", more=weight))
    touched = lying.green.touch(TOP, (0, 0, 0), CONTACT_RADIUS)
    met = approach_and_hold(0.003, 12_000)
    force = lying.run(met)[-1]
    stiffness = np.column_stack(
        [lying.green.touch(TOP, unit, CONTACT_RADIUS).force - touched.force for unit in np.eye(3)]
    )
    compliance = np.linalg.inv(stiffness) + np.eye(3) / COUPLING
    sunk = np.linalg.solve(stiffness, -touched.force)  # mean displacement of the patch by the weight
    assert sunk[2] < -1e-5
    # Displacement along the surface counts from the first touch; the material met there lies beside TOP by a little.
    expected = -np.linalg.solve(compliance, [0, 0, -0.003 - sunk[2]])
    assert force == pytest.approx(expected, rel=1e-3, abs=1e-3 * np.linalg.norm(expected))


@pytest.mark.slow
def test_a_strike_excites_each_mode_by_its_share(tmp_path):
    """After an impulse `J` on a patch `W` a mode swings as `Phi^T W J / omega sin(omega t)`, each on its own."""
    built = scene(tmp_path, "scheme = 'exact'\nmodes = 12\nrayleigh = [0, 0]\n")
    built = built.model_copy(update={"tools": [built.tools[0].model_copy(update={"contact_radius": 0.0})]})
    simulation = palpate.Simulation(built)
    basis, nodes = simulation.motion.basis, simulation.green.surface_nodes
    struck = int(np.argmin(np.linalg.norm(simulation.body.mesh.nodes - [0.108, 0.02, 0.03], axis=1)))
    impulse, dt, tick = np.array([4e-4, -3e-4, -1e-3]), 1e-3, 20
    played = simulation.play(
        np.full((1500, 3), np.nan), strikes=[(tick, simulation.body.mesh.nodes[struck], impulse)], watch=nodes
    )
    omega = 2 * np.pi * basis.frequencies
    # The force is held through the tick's step and the next, by delta = 0.6 and what is left of it: a mode hears each
    # dulled by sinc(omega dt / 2).
    share = basis.shapes[struck].T @ impulse / omega * np.sinc(omega * dt / 2 / np.pi)
    t = played.time - played.time[tick]
    after = t > 1.5 * dt
    swing = sum(w * np.sin(np.outer(omega, t[after] - middle)) for w, middle in ((0.6, -dt / 2), (0.4, dt / 2)))
    expected = np.einsum("nam,m,mt->tna", basis.shapes[nodes], share, swing)
    assert np.count_nonzero(np.abs(share) > 0.01 * np.abs(share).max()) > 5
    # The residual flexibility answers only while the force acts.
    assert played.displacements[after] == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_a_struck_body_rings_at_its_first_frequency(tmp_path):
    simulation = palpate.Simulation(scene(tmp_path, "damping_ratios = [0.01, 0.05]\n"))
    body = simulation.body
    tip = int(
        body.mesh.surface_nodes[np.argmin(np.linalg.norm(body.mesh.nodes[body.mesh.surface_nodes] - TOP, axis=1))]
    )
    away = np.full((6000, 3), np.nan)
    played = simulation.play(away, strikes=[(10, TOP, (0, 0, -2e-3))], watch=[tip])
    height = played.displacements[200:, 0, 2]
    crossings = np.flatnonzero(np.diff(np.sign(height)) > 0)
    frequency = 1e3 * (len(crossings) - 1) / (crossings[-1] - crossings[0])
    free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
    K, M = (m.tocsc()[free][:, free].toarray() for m in (skfem_stiffness(body), body.mass()))
    first = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=(0, 3))) / (2 * np.pi)
    assert frequency == pytest.approx(first[np.argmin(np.abs(first - frequency))], rel=0.02)
    assert frequency < 1.05 * first[1]
    assert np.abs(played.displacements[:10]).max() == 0


@pytest.mark.parametrize("weights", ["", "delta = 0.5\nalpha = 0.25\n", "scheme = 'exact'\n"])
@pytest.mark.parametrize("modes", ["'all'", "20"])
def test_energy_never_exceeds_the_work_of_the_hand(tmp_path, weights, modes):
    simulation = palpate.Simulation(scene(tmp_path, f"modes = {modes}\nrayleigh = [0, 0]\n{weights}"))
    t = np.arange(4000) * 1e-3
    depth = 0.006 * np.sin(2 * np.pi * 0.7 * t) * np.sin(2 * np.pi * 3.1 * t)
    path = TOP + np.array([0, 0, RADIUS]) - np.outer(depth, [0, 0, 1])
    played = simulation.play(path, strikes=[(3000, TOP, (1e-3, 0, -1e-3))])
    total, work = played.energy.total, played.energy.work
    peak = total.max()
    assert peak > 1e-5
    assert (total - work).max() < 1e-9 * peak
    touched = np.flatnonzero(np.linalg.norm(played.forces, axis=1) > 0)
    assert 500 < len(touched) < 3500


def test_undamped_average_acceleration_keeps_the_energy_of_a_strike(tmp_path):
    simulation = palpate.Simulation(scene(tmp_path, "rayleigh = [0, 0]\ndelta = 0.5\nalpha = 0.25\n"))
    played = simulation.play(np.full((5000, 3), np.nan), strikes=[(0, TOP, (0, 0, -1e-3))])
    total = played.energy.total[5:]
    assert total == pytest.approx(played.energy.work[-1], rel=1e-9)
    assert np.ptp(played.energy.work[5:]) == 0


def test_the_tool_meets_the_body_where_it_is(tmp_path):
    """A body swinging up against a tool that waits above it pushes it; at rest they would not touch."""
    simulation = palpate.Simulation(scene(tmp_path, ""))
    waiting = np.tile(TOP + [0, 0, RADIUS + 5e-4], (1500, 1))
    assert np.abs(simulation.run(waiting)).max() == 0
    forces = simulation.play(waiting, strikes=[(100, TOP, (0, 0, 1.2e-3))]).forces
    first = int(np.argmax(np.linalg.norm(forces, axis=1) > 0))
    assert 101 < first < 160
    assert (forces[:, 2] >= 0).all()


def test_a_long_strike_is_a_row_of_short_ones(tmp_path):
    """Half a wave in time: the motion is linear, so shifted and weighted answers to one of one step add up to it."""
    simulation = palpate.Simulation(scene(tmp_path, ""))
    away, watch = np.full((300, 3), np.nan), simulation.green.surface_nodes[::7]

    def after(*strike):
        return simulation.play(away, strikes=[(0, TOP, (0, 3e-4, -1e-3), *strike)], watch=watch).displacements

    short, steps = after(), 20
    assert np.array_equal(short, after(5e-4))
    shares = np.sin(np.pi * np.arange(1, steps + 1) / (steps + 1))
    shares /= shares.sum()
    expected = sum(s * np.concatenate([np.zeros_like(short[:k]), short[: 300 - k]]) for k, s in enumerate(shares))
    assert after(0.02) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    with pytest.raises(palpate.SceneError, match="duration must be a time of at least 0 s"):
        after(-1.0)


def test_slow_motion_and_the_running_loop(tmp_path):
    simulation = palpate.Simulation(scene(tmp_path, ""))
    away = np.full((800, 3), np.nan)
    again = [simulation.play(away, strikes=[(5, TOP, (0, 0, -2e-3))]).energy.total for _ in range(2)]
    assert np.array_equal(*again)
    with simulation:
        simulation.set_time_scale(0.5)
        simulation.strike(TOP, (0, 0, -2e-3))
        time.sleep(0.4)
        frame = simulation.frame()
        assert frame.energy.work == pytest.approx(
            simulation.play(away, strikes=[(5, TOP, (0, 0, -2e-3))]).energy.work[-1]
        )
        assert 0 < frame.energy.total <= frame.energy.work
        assert np.abs(frame.displacements).max() > 0
        simulation.reset()
        time.sleep(0.1)
        assert simulation.frame().energy.total == 0


def test_a_reset_in_slow_motion_lets_go_at_once(tmp_path):
    """A step comes due once in a hundred ticks; a reset does not wait for it, nor get lost between two."""
    simulation = palpate.Simulation(scene(tmp_path, "", fixed="z < 1e-6"))
    with simulation:
        simulation.move(TOP + [0, 0, RADIUS + 0.02])
        time.sleep(0.1)
        simulation.move(TOP + [0, 0, RADIUS - 0.003])
        time.sleep(0.5)
        assert len(simulation.frame().contacts) == 1
        simulation.set_time_scale(1e-3)
        simulation.remove()
        simulation.reset()
        time.sleep(0.1)
        frame = simulation.frame()
        assert frame.contacts == []
        assert np.abs(frame.forces).max() == 0
        assert frame.energy.total == frame.energy.work == 0


@pytest.mark.parametrize("modes", ["'all'", "20"])
def test_the_log_has_the_drawn_displacement_of_the_watched_node(tmp_path, modes):
    simulation = palpate.Simulation(scene(tmp_path, f"modes = {modes}\n", fixed="z < 1e-6"))
    node = int(simulation.green.surface_nodes[-3])
    with simulation:
        simulation.watch(node)
        simulation.move(TOP + [0, 0, RADIUS - 0.002])
        time.sleep(0.2)
        simulation.strike([0.12, 0, 0], (0, 1e-3, 0))
        time.sleep(0.05)
        frame = simulation.frame()
        time.sleep(0.02)
        log = simulation.drain_log()
    assert frame.contacts
    row = log[np.argmin(np.abs(log["time"] - frame.time))]
    drawn = frame.displacements[-3]
    assert row["watched"] == pytest.approx(drawn, abs=1e-9 * np.abs(drawn).max())
    assert row["kinetic"] == frame.energy.kinetic and row["work"] == frame.energy.work
    assert (np.diff(log["body_time"]) >= 0).all() and log["body_time"][-1] == pytest.approx(1e-3 * len(log), abs=3e-3)
    with pytest.raises(palpate.SceneError, match="is not on the surface"):
        simulation.watch(10**6)


@pytest.mark.parametrize(
    ("dynamics", "message"),
    [
        ("alpha = 0.1\n", r"dynamics: a step of .* is unstable .* the largest stable dt is"),
        ("modes = 5000\nalpha = 0.1", "unstable|modes"),
        ("dt = '2s'\n", r"beam.toml:\d+: dynamics.dt"),
        ("delta = 0.4\n", r"beam.toml:\d+: dynamics.delta"),
        ("rayleigh = [0, 0]\ndamping_ratios = [0, 0]\n", "give damping_ratios or rayleigh, not both"),
        ("dampning_ratios = [0, 0]\n", "unknown key 'dynamics.dampning_ratios'; did you mean 'damping_ratios'"),
        ("modes = 'few'\n", r"beam.toml:\d+: dynamics.modes"),
    ],
)
def test_mistakes_in_the_dynamics_table(tmp_path, dynamics, message):
    with pytest.raises(palpate.Error, match=message):
        scene(tmp_path, dynamics).build()


def test_a_coupling_beyond_the_device_is_refused(tmp_path):
    built = scene(tmp_path, "")
    (tmp_path / "beam.toml").write_text((tmp_path / "beam.toml").read_text().replace("500.0", "'9N/mm'"))
    assert built.dynamics.coupling == 500
    with pytest.raises(
        palpate.SceneError, match=r"beam.toml:\d+: dynamics: .*coupling = 9000 N/m is stiffer than device"
    ):
        palpate.Scene.read(tmp_path / "beam.toml").build()


def test_a_body_at_rest_cannot_be_struck(block, block_green):
    simulation = palpate.Simulation(palpate.Scene.of_store(block_green.path))
    with pytest.raises(
        palpate.SceneError, match=r"strike: the body does not move; give the scene a \[dynamics\] table"
    ):
        simulation.strike((0, 0, 0), (0, 0, 1))
    with pytest.raises(palpate.SceneError, match="does not move"):
        simulation.set_time_scale(0.5)
    with pytest.raises(palpate.SceneError, match="does not move"):
        simulation.play(np.zeros((3, 3)), strikes=[(0, (0, 0, 0), (0, 0, 1))])
