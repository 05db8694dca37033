"""Work and dissipation of modes that move exactly, against SciPy's integration of the full equations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from conftest import box_mesh
from scipy.integrate import solve_ivp

import palpate

RAYLEIGH = (1.0, 5e-4)
STEPS = 20


@pytest.fixture(scope="module")
def body() -> palpate.Body:
    return palpate.Body(box_mesh((3, 2, 2)), material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 0] < 1e-9)


def corner(body):
    return int(np.argmax(body.mesh.nodes.sum(axis=1)))


def forces_at_ends():
    return np.random.default_rng(1).normal(0, 0.1, (STEPS, 3))


def integrated(body, dt):
    """Kinetic, strain and dissipated energy and work under forces linear in time, and displacements of the corner."""
    free = np.setdiff1d(np.arange(3 * len(body.mesh.nodes)), body.fixed_dofs)
    K, M = (x.toarray()[np.ix_(free, free)] for x in (body.stiffness(), body.mass()))
    B = RAYLEIGH[0] * M + RAYLEIGH[1] * K
    inverse, size = np.linalg.inv(M), len(free)
    rows = np.searchsorted(free, 3 * corner(body) + np.arange(3))
    ends = np.vstack([np.zeros(3), forces_at_ends()])
    state, seen = np.zeros(2 * size + 2), [np.zeros(3)]
    for first, last in pairwise(ends):

        def slope(t, state, first=first, last=last):
            u, v = state[:size], state[size : 2 * size]
            load = np.zeros(size)
            load[rows] = first + (last - first) * t / dt
            resisting = B @ v
            return np.concatenate([v, inverse @ (load - resisting - K @ u), [v @ resisting, load @ v]])

        state = solve_ivp(slope, (0, dt), state, method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
        seen.append(state[rows])
    u, v = state[:size], state[size : 2 * size]
    return np.array([0.5 * v @ M @ v, 0.5 * u @ K @ u, *state[2 * size :]]), np.array(seen)


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_exact_modes_account_for_every_joule(body, dt):
    expected, seen = integrated(body, dt)
    motion = palpate.Newmark(body, dt, rayleigh=RAYLEIGH, method="exponential")
    motion.play([corner(body)], forces_at_ends()[:, None])
    energy = motion.energy
    booked = [energy.kinetic, energy.strain, energy.dissipated, energy.work]
    assert booked == pytest.approx(expected, rel=1e-8)
    # The means of both ends, right for average acceleration, are not the work of a force between them.
    ends = np.vstack([np.zeros(3), forces_at_ends()])
    by_means = (0.5 * (ends[1:] + ends[:-1]) * np.diff(seen, axis=0)).sum()
    assert abs(by_means / energy.work - 1) > 0.01


@pytest.mark.parametrize("modes", [None, 15])
@pytest.mark.parametrize("rayleigh", [(0.0, 0.0), RAYLEIGH])
def test_exact_modes_keep_their_energy(body, modes, rayleigh):
    """With the modes left out too, which store what is done on them."""
    motion = palpate.Newmark(body, 3e-3, rayleigh=rayleigh, method="exponential", modes=modes)
    motion.play([corner(body)], forces_at_ends()[:, None])
    energy = motion.energy
    assert energy.total + energy.dissipated == pytest.approx(energy.work, rel=1e-12)
    assert energy.dissipated == 0 if rayleigh == (0.0, 0.0) else energy.dissipated > 0.1 * energy.work
    motion.step(count=1)  # the force falls to zero
    before = motion.energy.total
    motion.step(count=5000)
    energy = motion.energy
    if rayleigh == (0.0, 0.0):
        assert energy.total == pytest.approx(before, rel=1e-9)
    assert energy.work == pytest.approx(energy.total + energy.dissipated, rel=1e-9)
