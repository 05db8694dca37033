"""The limit of strain hands out no energy: neither over a closed path of the tool, nor into a body that moves."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.scene import BuiltScene

RADIUS, PATCH = 0.005, 0.012
TOP = np.array([0.041, 0.026, 0.05])
UP = np.array([0.0, 0.0, 1.0])
DEVICE = {"ramp": 0, "max_force": 1e4, "max_slew": 1e9}


@pytest.mark.parametrize("limit", [0.0, 0.1])
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("across", [[0.0, 1.0, 0.0], [0.0, 0.0, 0.5]], ids=["level", "upright"])
def test_a_circle_of_the_tool_gives_out_no_energy(limit, sense, across):
    """The tool is beyond the limit all the way round, or held by nothing: the hand's work is zero, or is spent."""
    body = palpate.Body(box_mesh((8, 5, 5)), material=palpate.Material(10e3, 0.45), fixed=lambda p: p[:, 2] < 1e-9)
    green = palpate.precompute(body, precision="f64", progress=False)
    tables = {"body": {"store": "b.palpate"}, "tool": {"radius": RADIUS, "contact_radius": PATCH}, "device": DEVICE}
    simulation = palpate.Simulation(BuiltScene.of(palpate.Scene(view={"strain_limit": limit}, **tables), body, green))
    down = TOP + np.outer(RADIUS - np.linspace(-1e-4, 0.012, 300), UP)
    out = down[-1] + np.outer(np.linspace(0, 0.01, 100), [1.0, 0.0, 0.0])
    angle = np.linspace(0, 2 * np.pi, 1001)[:, None]
    circle = down[-1] + 0.01 * (np.cos(angle) * [1.0, 0.0, 0.0] + sense * np.sin(angle) * across)
    played = simulation.play(np.concatenate([down, out, circle]))
    forces = played.forces[-len(circle) :]
    assert (np.linalg.norm(forces, axis=1) > 0).all()
    assert (played.limited[-len(circle) :] == (limit > 0)).all()
    work = -np.einsum("ij,ij->i", (forces[1:] + forces[:-1]) / 2, np.diff(circle, axis=0))
    # The trapezoidal rule is exact to about the square of the step's angle. Beyond the limit the force is that of the
    # closest admissible displacement, found to some thousandths; one that is only shortened gives out a sixth.
    assert work.sum() >= -(1e-2 if limit else 1e-4) * np.abs(work).sum()


@pytest.mark.parametrize("limit", [0.0, 0.1])
def test_a_limited_press_puts_no_more_energy_into_a_moving_body_than_the_hand_gave(tmp_path, limit):
    box_mesh(cells=(10, 3, 3), size=(0.12, 0.03, 0.03), jitter=0).write(tmp_path / "beam.vtu")
    (tmp_path / "beam.toml").write_text(f"""
[body]
mesh = 'beam.vtu'
precision = 'f64'
[material]
youngs_modulus = '50kPa'
poissons_ratio = 0.4
[supports]
fixed = 'x < 1e-6'
[tool]
radius = 0.006
contact_radius = 0.008
[device]
max_force = 1000
max_slew = 1e9
ramp = 0
[view]
strain_limit = {limit}
[dynamics]
coupling = 500
modes = 20
rayleigh = [0, 0]
""")
    simulation = palpate.Simulation(palpate.Scene.read(tmp_path / "beam.toml"))
    t = 1e-3 * np.arange(4000)
    depth = 0.006 * np.sin(2 * np.pi * 0.7 * t) * np.sin(2 * np.pi * 3.1 * t)
    path = [0.10, 0.015, 0.036] - np.outer(depth, UP)
    played = simulation.play(path)
    total = played.energy.total
    assert total.max() > 1e-5
    # A contact that begins within the limit's first bound is taken up at once, by some thousandths of the energy.
    assert (total - played.energy.work).max() < (5e-3 if limit else 1e-3) * total.max()
    # Nor does the tool strike harder than without the limit.
    forces = (played.forces[1:] + played.forces[:-1]) / 2
    hand = -np.concatenate([[0.0], np.cumsum(np.einsum("ij,ij->i", forces, np.diff(path, axis=0)))])
    assert (total - hand).max() < (0.1 if limit else 0.05) * total.max()
