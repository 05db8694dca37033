"""Modes that move exactly, under contacts: against statics, SciPy's integration of the full body, and energy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from conftest import box_mesh, skfem_stiffness

import palpate

SIZE = (0.08, 0.05, 0.05)
TOP = np.array([0.042, 0.027, 0.05])
RADIUS, COUPLING = 0.006, 5000.0
EXACT, KEEPING = "scheme = 'exact'\n", "scheme = 'exact'\ndelta = 0.5\n"
AVERAGE = "delta = 0.5\nalpha = 0.25\n"
LAWS = {
    "patch": "contact_radius = '8mm'\n",
    "small patch": "contact_radius = '2mm'\n",
    "node": "contact = 'node'\n",
    "local": "contact = 'local'\n",
}


def simulation(folder, dynamics: str, tool: str, rate: int = 1000, cells=(6, 4, 4)) -> palpate.Simulation:
    """A soft block on a table, with all its modes unless ``dynamics`` says otherwise."""
    box_mesh(cells, SIZE, jitter=0.1).write(folder / "block.vtu")
    damping = "" if "rayleigh" in dynamics else "damping_ratios = [0.05, 0.05]\n"
    text = (
        "[body]\nmesh = 'block.vtu'\nprecision = 'f64'\n"
        "[material]\nyoungs_modulus = '20kPa'\npoissons_ratio = 0.45\ndensity = 1000\n"
        f"[supports]\nfixed = 'z < 1e-6'\n[tool]\nradius = {RADIUS}\n{tool}"
        f"[device]\nmax_force = '1kN'\nmax_slew = 1e9\nramp = 0\nmax_stiffness = {COUPLING}\nrate = {rate}\n"
        f"[view]\nstrain_limit = 0\n[dynamics]\n{damping}{dynamics}"
    )
    (folder / "block.toml").write_text(text)
    return palpate.Simulation(palpate.Scene.read(folder / "block.toml"))


def above(depths: np.ndarray, sideways: float = 0.0) -> np.ndarray:
    """Tool positions by depth, m, going sideways by so much a tick."""
    way = sideways * np.arange(len(depths))
    return TOP + np.outer(RADIUS - depths, [0, 0, 1]) + np.outer(way, [1, 0.5, 0])


def fall_and_hold(depth: float, ticks: int) -> np.ndarray:
    return above(np.minimum(2e-4 * np.arange(ticks), 1e-3 + depth) - 1e-3)


def press_and_lift(speed: float, depth: float, sideways: float = 0.0) -> np.ndarray:
    step = 1e-3 * speed
    down, up = np.arange(-1e-3, depth, step), np.arange(depth, -0.02, -step)
    return above(np.concatenate([down, np.full(50, depth), up, np.full(500, -0.02)]), sideways)


@pytest.mark.parametrize("modes", ["", "modes = 60\n"])
@pytest.mark.parametrize("law", LAWS)
def test_a_hold_settles_where_newmark_does_without_a_jump(tmp_path, law, modes):
    """Frictionless, for what rubs keeps a force along the surface that depends on how it came there."""
    tool = LAWS[law] + ("friction = 0\n" if law == "local" else "")
    forces = simulation(tmp_path, EXACT + modes, tool).run(fall_and_hold(0.004, 4000))
    others = simulation(tmp_path, modes, tool).run(fall_and_hold(0.004, 4000))
    size = np.linalg.norm(others[-1])
    assert forces[-1] == pytest.approx(others[-1], abs=1e-6 * size)
    steps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    assert steps[-2000:].max() < 2e-6 * size
    # Nor on landing, at most the coupling's force on the way of a tick.
    assert steps.max() < min(COUPLING * 2e-4, np.linalg.norm(np.diff(others, axis=0), axis=1).max())
    assert np.linalg.norm(forces, axis=1).max() < 1.2 * size


@pytest.mark.parametrize("law", ["patch", "small patch"])
def test_a_hold_settles_at_the_static_answer(tmp_path, law):
    loop = simulation(tmp_path, EXACT, LAWS[law])
    force = loop.run(fall_and_hold(0.004, 4000))[-1]
    radius = {"patch": 0.008, "small patch": 0.002}[law]
    stiffness = np.column_stack([loop.green.touch(TOP, unit, radius).force for unit in np.eye(3)])
    expected = np.linalg.solve(np.linalg.inv(stiffness) + np.eye(3) / COUPLING, [0, 0, 0.004])
    assert force == pytest.approx(expected, abs=1e-6 * np.linalg.norm(expected))


class SpringAndBody:
    """`M a + B v + K u = k_c W (d - W^T u)` under `d` linear in time between the ticks, by the matrix exponential."""

    def __init__(self, body: palpate.Body, node: int, rayleigh: tuple[float, float], tick: float):
        free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
        K, M = (m.tocsc()[free][:, free].toarray() for m in (skfem_stiffness(body), body.mass()))
        self.patch = np.searchsorted(free, 3 * node + np.arange(3))
        spring = np.zeros((len(free), 3))
        spring[self.patch] = COUPLING * np.eye(3)
        B = rayleigh[0] * M + rayleigh[1] * K
        K[np.ix_(self.patch, self.patch)] += COUPLING * np.eye(3)
        inverse, n = np.linalg.inv(M), len(free)
        system = np.zeros((2 * n + 6, 2 * n + 6))
        system[:n, n : 2 * n] = np.eye(n)
        system[n : 2 * n] = np.hstack([-inverse @ K, -inverse @ B, inverse @ spring, np.zeros((n, 3))])
        system[2 * n : 2 * n + 3, 2 * n + 3 :] = np.eye(3)
        self.step, self.tick, self.size = scipy.linalg.expm(tick * system), tick, 2 * n

    def forces(self, path: np.ndarray) -> np.ndarray:
        """On the device, N, at the end of each row's tick, for the tool's displacement from where it begins to push."""
        state, forces = np.zeros(self.size + 6), []
        for before, now in zip(np.vstack([np.zeros(3), path[:-1]]), path, strict=True):
            state[self.size :] = [*before, *(now - before) / self.tick]
            state = self.step @ state
            forces.append(-COUPLING * (now - state[self.patch]))
        return np.array(forces)


@pytest.mark.parametrize(("dynamics", "error", "order"), [(KEEPING, 0.002, 2.0), (EXACT, 0.003, 1.0)])
def test_a_press_converges_to_the_body_with_the_spring_built_in(tmp_path, dynamics, error, order):
    """A tool tied to one node; of second order with `delta` = 1/2, of first order above."""
    rayleigh, errors = (2.0, 5e-4), []
    for rate in (2000, 4000, 8000):
        settings = f"{dynamics}dt = {1 / rate}\nmodes = 'all'\nrayleigh = [{rayleigh[0]}, {rayleigh[1]}]\n"
        loop = simulation(tmp_path, settings, LAWS["node"], rate, cells=(4, 3, 3))
        body = loop.body
        node = int(np.argmin(np.linalg.norm(body.mesh.nodes - TOP, axis=1)))
        time = np.arange(1, int(0.3 * rate) + 1) / rate
        depth = 4e-3 * np.sin(np.pi * np.minimum(time / 0.08, 0.5)) ** 2
        path = np.outer(depth, [0, 0, -1]) + np.outer(5e-4 * np.sin(40 * time) * (depth / 4e-3), [1, 0.5, 0])
        forces = loop.run(body.mesh.nodes[node] + [0, 0, RADIUS] + path)
        expected = SpringAndBody(body, node, rayleigh, 1 / rate).forces(path)
        errors.append(np.abs(forces - expected).max() / np.abs(expected).max())
    assert errors[0] < error
    assert np.log2(errors[1] / errors[2]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("law", ["patch", "node"])
@pytest.mark.parametrize("dynamics", [AVERAGE, KEEPING])
@pytest.mark.parametrize("rayleigh", ["", "rayleigh = [0, 0]\n"])
@pytest.mark.parametrize(("speed", "sideways"), [(0.2, 0.0), (1.5, 0.0), (1.5, 1e-4)])
def test_every_joule_of_a_sticking_contact_is_accounted_for(tmp_path, law, dynamics, rayleigh, speed, sideways):
    """Landing, slipping and letting go too; none is given out."""
    played = simulation(tmp_path, dynamics + rayleigh, LAWS[law]).play(press_and_lift(speed, 0.005, sideways))
    energy, peak = played.energy, played.energy.total.max()
    assert (np.abs(played.forces).max(axis=1) > 0).any()
    assert (played.forces[-1] == 0).all()
    assert energy.total + energy.dissipated == pytest.approx(energy.work, abs=1e-9 * peak)
    assert np.diff(energy.dissipated).min() > -1e-12 * peak


@pytest.mark.parametrize("dynamics", ["", AVERAGE, EXACT, KEEPING])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("speed", "sideways"), [(0.05, 1e-4), (1.5, 0.0)])
def test_no_law_gives_out_more_than_was_put_in(tmp_path, law, dynamics, speed, sideways):
    played = simulation(tmp_path, f"{dynamics}rayleigh = [0, 0]\n", LAWS[law])
    energy = played.play(press_and_lift(speed, 0.005, sideways)).energy
    peak = energy.total.max()
    assert (energy.total - energy.work).max() < 1e-9 * peak
    # What rubs, or bends the law within a step, is booked to a thousandth of the work.
    bound = 2e-3 if law == "local" else 1e-9
    if "delta = 0.5" in dynamics:
        assert (energy.total + energy.dissipated - energy.work).max() < bound * energy.work.max()


def test_a_tool_bound_by_a_stiff_spring_does_not_swing_itself_up(tmp_path):
    """Undamped, a tenth of a millisecond to ten of them: no step makes a lasting contact unstable."""
    for dt in ("0.2ms", "1ms", "5ms"):
        loop = simulation(tmp_path, f"{EXACT}dt = '{dt}'\nrayleigh = [0, 0]\n", LAWS["node"], cells=(4, 3, 3))
        energy = loop.play(fall_and_hold(0.003, 3000)).energy
        assert (energy.total[1000:] < 1.5 * energy.total[30:1000].max()).all()
        assert (energy.total <= energy.work * (1 + 1e-9) + 1e-15).all()
