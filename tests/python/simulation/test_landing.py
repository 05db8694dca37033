"""Landing on a body with the limit of strain in the loop: no overshoot of strain or force.

The true largest strain of every tick's pose is measured offline over all elements; the loop watches a few.
"""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate.scene import BuiltScene

LIMIT, RADIUS, DEPTH, CLEARANCE = 0.1, 0.005, 0.008, 0.002
UP = np.array([0.0, 0.0, 1.0])
# Time constant of the simulated device's hand, s.
HAND = 0.008
PATCHES, MODULI = (0.002, 0.008, 0.025), (1e3, 10e3, 100e3)
# Nothing limits the force but the limit of strain.
DEVICE = {"ramp": 0, "max_force": 1e4, "max_slew": 1e9}


def jump(top: np.ndarray) -> np.ndarray:
    """Tool as the simulated device moves when its target jumps from above the surface to deep below: `(1 + t) e^-t`."""
    t = 1e-3 * np.arange(1, 251)[:, None] / HAND
    return top + (RADIUS - DEPTH + (1 + t) * np.exp(-t) * (CLEARANCE + DEPTH)) * UP


def steady(top: np.ndarray, speed: float = 0.1) -> np.ndarray:
    """Tool that comes down at a speed, m/s, and stands still at the depth."""
    fallen = np.minimum(speed * 1e-3 * np.arange(1, 251), CLEARANCE + DEPTH)[:, None]
    return top + (RADIUS + CLEARANCE - fallen) * UP


def body_called(name: str) -> palpate.Body:
    material = palpate.Material(10e3, 0.45)
    if name == "block":
        return palpate.Body(box_mesh((8, 5, 5)), material=material, fixed=lambda p: p[:, 2] < 1e-9)
    mesh = palpate.models.load(name, paper=True)
    return palpate.Body(mesh, material=material, fixed=palpate.models.fixed(name, mesh))


def highest_point(green: palpate.GreensFunction) -> np.ndarray:
    """Free surface node that is about highest, and nearest to the middle."""
    nodes = green.surface_positions
    free = nodes[~np.isin(green.surface_nodes, green.fixed_nodes)]
    high = free[free[:, 2] > free[:, 2].max() - 0.01 * np.ptp(nodes, axis=0).max()]
    return high[np.argmin(np.linalg.norm(high[:, :2] - nodes[:, :2].mean(axis=0), axis=1))]


def land(body: palpate.Body, green: palpate.GreensFunction, patch: float, modulus: float, path_to) -> np.ndarray:
    """Force, N, and true largest strain (2, t) at each tick from the first touch on, and when settled."""
    tables = {"body": {"store": "b.palpate"}, "tool": {"radius": RADIUS, "contact_radius": patch}, "device": DEVICE}
    simulation = palpate.Simulation(BuiltScene.of(palpate.Scene(view={"strain_limit": LIMIT}, **tables), body, green))
    simulation.set_youngs_modulus(modulus)
    played = simulation.play(path_to(highest_point(green)), watch=green.surface_nodes)
    force = np.linalg.norm(played.forces, axis=1)
    touched = force > 0
    first = int(np.argmax(touched))
    assert touched[first:].all(), "the contact is lost"
    # After a tenth of a second nothing changes any more.
    ticks = [*range(first, first + 100), len(force) - 1]
    measure = green.strain_measure
    strain = np.array([measure.largest(played.displacements[tick]) for tick in ticks])
    assert strain[-1] == pytest.approx(strain[-2], rel=1e-3)
    assert played.limited[-1] == (strain[-1] > 0.99 * LIMIT)
    return np.array([force[ticks], strain])


def check(name: str, patches=PATCHES, moduli=MODULI) -> None:
    body = body_called(name)
    green = palpate.precompute(body, progress=False)
    landed = 0
    for patch in patches:
        for modulus in moduli:
            for path_to in (jump, steady):
                try:
                    force, strain = land(body, green, patch, modulus, path_to)
                except palpate.Error as error:
                    assert "contact" in str(error) and "256" in str(error), error
                    continue
                case = f"{name}, patch {patch} m, {modulus} Pa, {path_to.__name__}"
                assert strain.max() <= 1.1 * LIMIT, case
                assert force.max() <= 1.1 * force[-1], case
                # Held at the limit, or pressed as deep as the tool is.
                # The limit is watched at the places that matter most, which may miss some of the largest strain.
                assert strain[-1] < 0.99 * LIMIT or 0.995 * LIMIT <= strain[-1] <= 1.03 * LIMIT, case
                landed += 1
    assert landed


@pytest.mark.parametrize(("name", "patch"), [("block", 0.008), ("block", 0.025), ("liver", 0.025), ("doll", 0.002)])
def test_landing_passes_neither_limit_nor_settled_force(name, patch):
    check(name, patches=[patch], moduli=[100e3])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block", "liver", "kidney", "doll", "beam"])
def test_landing_on_every_body_with_every_patch_and_stiffness(name):
    check(name)


def test_without_the_limit_the_same_landing_passes_it():
    """What is checked above can fail: the block is strained by more than the limit and pushes harder."""
    body = body_called("block")
    green = palpate.precompute(body, progress=False)
    tables = {"body": {"store": "b.palpate"}, "tool": {"radius": RADIUS, "contact_radius": 0.025}, "device": DEVICE}
    free = palpate.Simulation(BuiltScene.of(palpate.Scene(view={"strain_limit": 0}, **tables), body, green))
    played = free.play(jump(highest_point(green)), watch=green.surface_nodes)
    assert green.strain_measure.largest(played.displacements[-1]) > 1.3 * LIMIT
