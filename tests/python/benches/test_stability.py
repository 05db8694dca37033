"""The largest stable stiffness and touches by simulated hands: a few of each, beside theory."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import palpate
from benches import touches, zwidth
from benches.emulation import (
    FIRM,
    LOOSE,
    Device,
    Held,
    Mechanics,
    emulate,
    frictionless,
    known_devices,
)
from benches.sampled_loop import bound_for_any_hand, largest_stable

BLOCK = Path(__file__).parents[3] / "examples" / "block.toml"


@pytest.fixture(scope="module")
def spring():
    return zwidth.Spring()


@pytest.fixture(scope="module")
def devices():
    return known_devices()


@pytest.mark.parametrize(("mass", "delay"), [(0.05, 0.0), (0.05, 1.3e-3), (0.002, 0.25e-3)])
def test_the_loop_holds_what_the_eigenvalues_say_and_the_stage_changes_nothing(spring, tmp_path, mass, delay):
    row = zwidth.measure(spring, Mechanics(mass, 1.0, delay=delay))
    assert row.bare == pytest.approx(row.eigenvalue, rel=0.01)
    assert row.controlled == pytest.approx(row.eigenvalue, rel=0.01)
    assert row.whole == pytest.approx(row.eigenvalue, rel=0.01)
    # A heavy tip needs all its damping, a light one less.
    low, high = (1.0, 1.02) if mass > 0.01 else (1.05, 1.2)
    assert low < row.eigenvalue / row.any_hand < high
    zwidth.write([row], tmp_path / "map.csv")
    with (tmp_path / "map.csv").open() as file:
        assert float(next(csv.DictReader(file))["bare"]) == row.bare
    zwidth.plot([row], tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


@pytest.mark.parametrize("hand", [LOOSE, FIRM], ids=["loose", "firm"])
def test_a_hand_adds_its_damping(spring, hand):
    alone = Mechanics(0.1, 0.5, delay=1e-3)
    expected = largest_stable(alone, zwidth.PERIOD, hand)
    assert expected > bound_for_any_hand(alone.damping + hand.damping, zwidth.PERIOD, alone.delay)
    assert spring.largest_stable(Device("emulated", alone), hand) == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
def test_touches_of_an_example_come_to_rest(devices, shared_cache):
    built = palpate.Scene.read(BLOCK).build(progress=False)
    chosen = [devices["Touch"], frictionless(devices["Touch"]), frictionless(devices["omega"])]
    for touch in touches.touch_with_all(built, chosen):
        assert touch.stable, touch
        # It was a touch, and not one that the largest force of the device cut short.
        assert 0.2 < touch.force < 3.0


def test_a_touch_holds_a_firm_body_by_its_limit_and_a_hard_one_shows_instability(spring, devices):
    for touch, expected in touches.controls(spring, devices["Touch"]):
        assert expected is None or touch.stable == expected, touch


def test_a_tool_that_may_ask_for_more_than_the_device_holds_is_refused(spring, devices):
    device = devices["Touch"]
    simulation = spring.pressed(800.0, 800.0)
    with pytest.raises(palpate.Error, match="at most 400 N/m: lower max_stiffness to 400"):
        emulate(simulation, [Held(device, spring.place)], 1e-3, 10)
    emulate(simulation, [Held(replace(device, max_stiffness=800.0), spring.place)], 1e-3, 10)


def test_unrest_is_the_range_about_the_drift():
    time = np.arange(1000) * 1e-3
    place = np.stack([0.01 * time, 3e-5 * np.sin(400 * time), 0 * time], axis=1)[:, None]
    motion = touches.Motion(place, place, place, place)
    assert touches.unrest_before(motion, 1.0, 1e-3) == pytest.approx(3e-5, rel=0.02)
