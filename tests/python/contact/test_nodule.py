"""A fingertip over the nodule of the example: how much harder it feels, beside a direct solution of a fine mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.contact import tools
from palpate.validation.verify.contact.loop import UNLIMITED, straight
from palpate.validation.verify.contact.reference import Block, Nodule

EXAMPLE = Path(__file__).parents[3] / "examples" / "nodule.toml"
MIDDLE, TOP, DEPTH, DEEPER = 0.04, 0.04, 1.5e-3, 0.1e-3
# Young's modulus of the nodule, Pa, and its radius, m: contrasts of 7, 14 and 30 per cent.
NODULES = ((11e3, 5e-3), (26e3, 5e-3), (13.5e3, 7e-3))
# Edge of the elements of the direct solution under the tool and around the nodule, m. Twice as large ones find
# contrasts lower by two points: they do not resolve the nodule.
CELL, COARSE_CELL = 1.5e-3, 2e-3
# Largest difference from the direct contrast.
POINTS = 0.02


def scene(youngs_modulus: float, radius: float) -> palpate.Scene:
    found = palpate.Scene.read(EXAMPLE)
    region = found.region[0].model_copy(update={"youngs_modulus": youngs_modulus, "radius": radius})
    tool = found.tools[0].model_copy(update={"contact": "local", "friction": 0.0})
    device = found.device.model_copy(update=UNLIMITED)
    view = found.view.model_copy(update={"strain_limit": 0.0})
    made = found.model_copy(update={"region": [region], "tools": [tool], "device": device, "view": view})
    made._source = found._source
    return made


def felt(built: BuiltScene, line: np.ndarray) -> np.ndarray:
    """Force, N, and stiffness, N/m, (n, 2) of a fingertip that slides at constant depth along the line."""
    radius = built.scene.tools[0].radius
    results = []
    for depth in (DEPTH - DEEPER, DEPTH, DEPTH + DEEPER):
        path = np.column_stack([line, np.full(len(line), MIDDLE), np.full(len(line), TOP + radius - depth)])
        lead = straight(path[0] + (0, 0, 3e-3), path[0], 1e-4)
        results.append(palpate.Simulation(built).run(np.vstack([lead, path]))[len(lead) :, 2])
    return np.column_stack([results[1], (results[2] - results[0]) / (2 * DEEPER)])


def direct(radius: float, nodule: Nodule, cell: float = CELL) -> np.ndarray:
    """Force, N, and stiffness, N/m, of the directly solved problem."""
    block = Block((0.08, 0.08, 0.04), palpate.Material(5e3, 0.45), nodule)
    place = None if nodule.aside == 0 else (MIDDLE + nodule.aside, MIDDLE)
    depths = [DEPTH - DEEPER, DEPTH, DEPTH + DEEPER]
    presses = block.pressed(tools.sphere(radius), depths, 1.3 * np.sqrt(radius * DEPTH), cell, place=place)
    low, at, high = (press.force for press in presses)
    return np.array([at, (high - low) / (2 * DEEPER)])


@pytest.fixture(scope="module")
def plain():
    """The tissue of the example without what is hidden in it."""
    return scene(5e3, NODULES[0][1]).build(progress=False)


@pytest.mark.slow
def test_a_nodule_is_felt_as_the_direct_solution_says(plain):
    line = np.linspace(0.02, 0.06, 81)
    without = felt(plain, line)
    tool = plain.scene.tools[0].radius
    # The mesh of a direct solution follows the nodule; its error cancels only against the same mesh without one.
    base = {radius: direct(tool, Nodule(0.01, radius, 5e3)) for radius in (5e-3, 7e-3)}
    for youngs_modulus, radius in NODULES:
        gain = felt(scene(youngs_modulus, radius).build(progress=False), line) / without - 1
        expected = direct(tool, Nodule(0.01, radius, youngs_modulus)) / base[radius] - 1
        print(f"E {youngs_modulus:g} Pa, radius {radius:g} m: {gain[len(line) // 2]}, direct {expected}")
        assert np.abs(gain[len(line) // 2] - expected).max() < POINTS
        # It is felt where it is, and is gone twenty millimetres away.
        assert np.abs(line[gain.argmax(axis=0)] - MIDDLE).max() < 2e-3
        assert np.abs(gain[[0, -1]]).max() < 0.02
        # Tolerances that can fail: another force on the body with the nodule, or another sign.
        for wrong in (1.05, -1.0):
            assert np.abs(wrong * (1 + gain[len(line) // 2]) - (1 + expected)).min() > POINTS


@pytest.mark.slow
def test_the_profile_is_the_same_there_and_back():
    built = scene(*NODULES[1]).build(progress=False)
    line = np.linspace(0.03, 0.05, 201)
    there, back = felt(built, line)[:, 0], felt(built, line[::-1])[::-1, 0]
    # Without friction the force is one of the place alone; one of the tick before would lie 0.2 mm apart.
    assert np.abs(there - back).max() < 1e-6 * there.max()
    assert np.abs(there[:-1] - back[1:]).max() > 1e-4 * there.max()


@pytest.mark.slow
def test_the_profile_beside_a_nodule_is_that_of_the_direct_solution(plain):
    youngs_modulus, radius = NODULES[1]
    aside = np.array([4e-3, 8e-3])
    line = MIDDLE - aside[::-1]
    tool = plain.scene.tools[0].radius
    gain = (felt(scene(youngs_modulus, radius).build(progress=False), line) / felt(plain, line) - 1)[::-1]
    for distance, found in zip(aside, gain, strict=True):
        base, hard = (direct(tool, Nodule(0.01, radius, e, distance), COARSE_CELL) for e in (5e3, youngs_modulus))
        print(f"{distance:g} m beside: {found}, direct {hard / base - 1}")
        assert np.abs(found - (hard / base - 1)).max() < POINTS
