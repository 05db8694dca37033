"""A fingertip over the nodule of the example: how much harder it feels, beside a direct solution of a fine mesh."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.scene.regions import TouchTable
from palpate.validation.verify.contact.hidden_ball import HiddenBall
from palpate.validation.verify.contact.loop import UNLIMITED, straight

EXAMPLE = Path(__file__).parents[3] / "examples" / "nodule.toml"
MIDDLE, TOP, DEPTH, DEEPER = 0.04, 0.04, 1.5e-3, 0.2e-3
SOFT = palpate.Material(5e3, 0.45)
# Young's modulus of the nodule, Pa, and its radius, m, 10 mm deep: contrasts of 6, 12 and 27 per cent.
NODULES = ((11e3, 5e-3), (26e3, 5e-3), (13.5e3, 7e-3))
# What `contrasts` finds for the last one, and `HiddenBall(0.01, 5e-3, (ASIDE, 0.0))` beside the second: their elements
# take a minute, and are none of ours.
LARGE = [np.array([0.266, 0.293])]
ASIDE, BESIDE = 5e-3, np.array([0.0696, 0.0930])
# Largest difference from the direct contrasts: a body of several materials has a narrower mask, from which more is
# taken off for its elements than from the even one.
POINTS = 0.03
# The fingertip's way with a patch around it: the whole surface gives the same forces to 0.02 %.
TOUCHED = "z > 39.9mm and y > 27mm and y < 53mm and x > 7mm and x < 73mm"


def scene(youngs_modulus: float, radius: float) -> palpate.Scene:
    found = palpate.Scene.read(EXAMPLE)
    region = found.region[0].model_copy(update={"youngs_modulus": youngs_modulus, "radius": radius})
    tool = found.tools[0].model_copy(update={"contact": "local", "friction": 0.0})
    device = found.device.model_copy(update=UNLIMITED)
    view = found.view.model_copy(update={"strain_limit": 0.0})
    update = {"region": [region], "tools": [tool], "device": device, "view": view, "touch": TouchTable(region=TOUCHED)}
    result = found.model_copy(update=update)
    result._source = found._source
    return result


def felt(built: BuiltScene, line: np.ndarray) -> np.ndarray:
    """Force, N, and stiffness, N/m, (n, 2) of a fingertip that slides at constant depth along the line."""
    radius = built.scene.tools[0].radius
    results = []
    for depth in (DEPTH - DEEPER, DEPTH, DEPTH + DEEPER):
        path = np.column_stack([line, np.full(len(line), MIDDLE), np.full(len(line), TOP + radius - depth)])
        lead = straight(path[0] + (0, 0, 3e-3), path[0], 1e-4)
        results.append(palpate.Simulation(built).run(np.vstack([lead, path]))[len(lead) :, 2])
    return np.column_stack([results[1], (results[2] - results[0]) / (2 * DEEPER)])


def force_and_stiffness(forces: np.ndarray) -> np.ndarray:
    """N, and N/m, from the forces at three depths (3,)."""
    return np.array([forces[1], (forces[2] - forces[0]) / (2 * DEEPER)])


def contrasts(tool: float, radius: float, moduli: list[float]) -> list[np.ndarray]:
    """How much larger force and stiffness are by the direct solution, for each nodule of a radius."""
    depths = [DEPTH - DEEPER, DEPTH, DEPTH + DEEPER]
    forces = HiddenBall(0.01, radius).pressed(tool, depths, SOFT, [SOFT.youngs_modulus, *moduli])
    base, *hard = (force_and_stiffness(row) for row in forces)
    return [found / base - 1 for found in hard]


@pytest.fixture(scope="module")
def with_nodule(cache):
    """A scene with a nodule of a Young's modulus, Pa, and a radius, m, of which each is solved once."""

    @functools.cache
    def build(youngs_modulus: float, radius: float) -> BuiltScene:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("XDG_CACHE_HOME", str(cache))
            return scene(youngs_modulus, radius).build(progress=False)

    return build


@pytest.fixture(scope="module")
def plain(with_nodule):
    """The tissue of the example without what is hidden in it."""
    return with_nodule(5e3, NODULES[0][1])


@pytest.mark.slow
@pytest.mark.campaign(2)
@pytest.mark.parametrize("radius", sorted({radius for _, radius in NODULES}, reverse=True))
def test_a_nodule_is_felt_as_the_direct_solution_says(plain, with_nodule, radius):
    line = np.linspace(0.02, 0.06, 81)
    middle = len(line) // 2
    without = felt(plain, line)
    moduli = [modulus for modulus, other in NODULES if other == radius]
    direct = LARGE if radius == NODULES[2][1] else contrasts(plain.scene.tools[0].radius, radius, moduli)
    for modulus, expected in zip(moduli, direct, strict=True):
        gain = felt(with_nodule(modulus, radius), line) / without - 1
        print(f"E {modulus:g} Pa, radius {radius:g} m: {gain[middle]}, direct {expected}")
        assert np.abs(gain[middle] - expected).max() < POINTS
        # It is felt where it is, and is gone twenty millimetres away.
        assert np.abs(line[gain.argmax(axis=0)] - MIDDLE).max() < 2e-3
        assert np.abs(gain[[0, -1]]).max() < 0.02
        # Tolerances that can fail: another force on the body with the nodule, or another sign.
        for wrong in (1.05, -1.0):
            assert np.abs(wrong * (1 + gain[middle]) - (1 + expected)).min() > POINTS


@pytest.mark.slow
def test_beside_the_nodule_the_force_is_that_of_the_direct_solution(plain, with_nodule):
    line = np.array([MIDDLE - ASIDE, MIDDLE + ASIDE])
    gain = felt(with_nodule(*NODULES[1]), line) / felt(plain, line) - 1
    print(f"{ASIDE:g} m beside: {gain}")
    assert np.abs(gain - BESIDE).max() < POINTS


@pytest.mark.slow
def test_the_profile_is_the_same_there_and_back(with_nodule):
    built = with_nodule(*NODULES[1])
    line = np.linspace(0.03, 0.05, 201)
    there, back = felt(built, line)[:, 0], felt(built, line[::-1])[::-1, 0]
    # Without friction the force is one of the place alone; one of the tick before would lie 0.2 mm apart.
    assert np.abs(there - back).max() < 1e-6 * there.max()
    assert np.abs(there[:-1] - back[1:]).max() > 1e-4 * there.max()
