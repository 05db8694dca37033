"""Random first touches: no tick computes a force far above that of the press which follows.

A flat punch or the side of a capsule that lies exactly on the surface, and touches it by less than a nanometre, once
computed up to 1e6 N in that tick.
"""

from __future__ import annotations

import numpy as np
import pytest
from crossings import LYING, TOOLS, UP, Loops, lowest, played, surface_places, upright_on

STEP, DEEP, ABOVE = 10e-6, 1e-3, 0.5e-3
# The largest force of a tick over that at the end, and a force that no hand feels, N.
MOST, UNFELT = 3.0, 1e-3
HELD = {
    "sphere": ["upright"],
    "ellipsoid": ["lying", "upright"],
    "capsule": ["lying", "lying", "upright"],
    "punch": ["upright"],
    "file": ["lying", "upright"],
}


def excess(forces: np.ndarray) -> float:
    """Largest force of a press over the force at its end; infinite for a number that is not finite."""
    if not np.isfinite(forces).all():
        return np.inf
    size = np.linalg.norm(forces, axis=1)
    return 0.0 if size.max() <= UNFELT else float(size.max() / max(size[-1], UNFELT))


def touches(loops: Loops, name: str, tool: str, count: int, seed: int):
    """Press a tool ``count`` times, aligned with the smooth surface, 10 um a tick: excess and where, of each."""
    random = np.random.default_rng(seed)
    body, green = loops.body(name)
    simulation = loops.loop(name, tool, friction=0.3 * (seed % 2))
    feet, normals, _ = simulation.closest(surface_places(green, body, count, seed))
    for foot, normal in zip(feet, normals, strict=True):
        rotation = upright_on(normal, random.uniform(0, 2 * np.pi))
        if random.choice(HELD[tool]) == "lying":
            rotation = rotation * LYING
        way = UP if normal[2] > 0.3 and random.random() < 0.3 else normal
        # Of half of the touches one tick is at the surface but for rounding.
        phase = 0.0 if random.random() < 0.5 else random.uniform(0, STEP)
        start = foot - lowest(tool, rotation, normal) + phase * way
        down = np.arange(-ABOVE, DEEP + 2 * STEP, STEP)
        found = played(simulation, start - down[:, None] * way, rotation)
        # A tool that touches elsewhere before it comes to the point is another press.
        if found.size[0] == 0:
            yield excess(found.forces), foot


def worst(loops: Loops, name: str, tool: str, count: int, seed: int) -> str | None:
    """What is wrong with the touches of a tool; None if nothing is."""
    found = list(touches(loops, name, tool, count, seed))
    assert len(found) > count / 3, f"only {len(found)} of {count} places of {name} can be touched by a {tool}"
    bad = [(part, foot) for part, foot in found if part > MOST]
    if not bad:
        return None
    part, foot = max(bad, key=lambda pair: pair[0])
    return f"{tool} on {name}: {len(bad)} of {len(found)} touches, worst {part:.3g} times the force at 1 mm, at {foot}"


@pytest.mark.campaign(3)
@pytest.mark.parametrize("tool", [pytest.param(tool, marks=[pytest.mark.slow] * (tool == "file")) for tool in HELD])
@pytest.mark.parametrize(
    "name", ["kidney", *(pytest.param(name, marks=pytest.mark.slow) for name in ("liver", "star"))]
)
def test_no_first_touch_computes_more_than_three_times_the_force_at_a_millimetre(loops, name, tool, rounds):
    wrong = worst(loops, name, tool, rounds(120), seed=len(name) + len(tool))
    assert wrong is None, wrong


@pytest.mark.slow
@pytest.mark.campaign(2)
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", ["kidney in full", "liver in full", "doll", "block", "torus", "cup", "star"])
def test_many_first_touches_on_every_body(loops, name, rounds):
    runs = [(tool, seed) for tool in HELD for seed in [1, 2][: 1 + (tool in ("capsule", "punch"))]]
    wrong = [worst(loops, name, tool, rounds(46), seed) for tool, seed in runs]
    assert not any(wrong), "; ".join(filter(None, wrong))


def test_the_check_sees_one_tick_that_is_wrong():
    """Forces of a press as it should be, and with one tick as it was."""
    press = np.zeros((150, 3))
    press[50:, 2] = 0.1 * (np.arange(100) / 100) ** 1.5
    assert excess(press) <= MOST
    for tick, force in ((50, 2.0), (51, -16890.0), (120, 0.4), (60, np.nan)):
        falsified = press.copy()
        falsified[tick, 0] = force
        assert excess(falsified) > MOST
    # A contact that is lost at the end is not judged by its own force.
    lost = press.copy()
    lost[-1] = 0.0
    assert excess(lost) > MOST
    assert set(HELD) <= set(TOOLS)
