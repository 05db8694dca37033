"""The stiffness map of a slab with a hidden nodule, beside direct solutions; nodules found where they are."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from palpate.body import Material
from palpate.palpation import Nodule, StiffnessMap, compare, stiffness_map
from palpate.scene import BuiltScene, Scene
from palpate.validation.verify.benchmark import Check, Outcome
from palpate.validation.verify.contact.hidden_ball import HiddenBall

Point = tuple[float, float]

# The slab of examples/nodule.toml: half its width, and its height, m; Pa; m.
SIZE = 0.04
SOFT, MODULUS, BALL, BELOW, TOOL = Material(5e3, 0.45), 40e3, 0.005, 0.01, 0.005
# Where the map is measured, from the middle of the top, m: 25 points, of which six are no mirror images of others.
OFFSETS = 0.01 * np.arange(-2, 3)
# Deeper, 0.8 R wide, what the law knows of a nodule is extrapolated (docs/palpation.md).
DEPTH, DEEP = 1.5e-3, 3e-3
# Direct forces at these parts of the depth tell its slope.
PARTS = np.linspace(0.7, 1.3, 7)
# The one over the nodule.
OVER = 12
# Nodules that are looked for: place on the top, depth of the middle, radius, m; and the grid, m.
HIDDEN = (((0.04, 0.04), 0.010, 0.005), ((0.033, 0.046), 0.010, 0.005), ((0.052, 0.029), 0.014, 0.007))
GRID = 0.01
# Largest error of the map; so far from the truth a coordinate of a place may be, m: 2 mm both together.
# A slope is the derivative of forces that are themselves right to 1 or 2 %.
TOLERANCES, PLACE = {"F/d": 0.02, "dF/dd": 0.03}, 1.4e-3
SOURCE = "elements along the ball"


def palpation() -> Outcome:
    """Stiffness of the slab at 25 points and deeper over the nodule, and the places of nodules."""
    with tempfile.TemporaryDirectory() as folder:
        built = slab(Path(folder), (SIZE, SIZE), BELOW, BALL, _line()).build(progress=False)
    found = map_at_points(built, DEPTH)
    direct = np.array([direct_press(*sorted(np.abs(at).tolist(), reverse=True), DEPTH) for at in offsets()])
    deep, deep_direct = map_at_points(built, DEEP), direct_press(0.0, 0.0, DEEP)
    checks = []
    for rank, (name, tolerance) in enumerate(TOLERANCES.items()):
        computed, truth = (found.secant_stiffness, found.stiffness)[rank], direct[:, rank]
        off = float(np.abs(computed / truth - 1).max())
        below = (float((deep.secant_stiffness, deep.stiffness)[rank][OVER]), float(deep_direct[rank]))
        checks += [
            Check(f"{name}, 1.5 mm deep over it", float(computed[OVER]), float(truth[OVER]), SOURCE, tolerance, "N/m"),
            Check(f"{name}, 1.5 mm deep: largest of 25", off, 0.0, SOURCE, tolerance),
            Check(f"{name}, 3 mm deep over it", *below, SOURCE, None, "N/m"),
        ]
    return Outcome(checks + [check for hidden in HIDDEN for check in _found(*hidden)])


def offsets() -> np.ndarray:
    """Points from the middle of the top, (25, 2) m."""
    return np.array([(x, y) for y in OFFSETS for x in OFFSETS])


def map_at_points(built: BuiltScene, depth: float) -> StiffnessMap:
    """Map at the 25 points of the slab."""
    places = np.column_stack([SIZE + offsets(), np.full(len(OFFSETS) ** 2, SIZE)])
    return stiffness_map(built, GRID, depth, points=places)


@cache
def direct_press(x: float, y: float, depth: float) -> tuple[float, float]:
    """Solve a sphere beside the middle by offsets, m, directly: F/d and dF/dd, N/m, at a depth, m."""
    ball = HiddenBall(BELOW, BALL, (x, y), SIZE)
    (forces,) = ball.pressed(TOOL, (depth * PARTS).tolist(), SOFT, [MODULUS])
    force, slope = smooth_at(depth * PARTS, forces, depth)
    return force / depth, slope


def smooth_at(depths: np.ndarray, forces: np.ndarray, at: float) -> tuple[float, float]:
    """Force, N, and slope, N/m, at a depth, from direct forces (n,) around it.

    Hertz's power is taken out, `F = g(d) d^(3/2)`, and a parabola fitted to `g`, which the growing contact makes rough.
    """
    _, first, value = np.polyfit(depths / at - 1, forces / depths**1.5, 2)
    return value * at**1.5, (1.5 * value + first) * at**0.5


def slab(
    folder: Path, place: Point, below: float, radius: float, finer: Sequence[Point] = (), size: float = SIZE
) -> Scene:
    """Return a slab with a ball below a place of its top; elements are finer in the ball, and under some places, m.

    It is twice as wide as high; its surface is written into a folder.
    """
    from trimesh.creation import box

    centre = (*place, size - below)
    sizes = [{"center": centre, "radius": radius + 3e-3, "size": 2e-3}]
    sizes += [{"center": (*at, size), "radius": 7e-3, "size": 2.4e-3} for at in finer]
    file = folder / "slab.stl"
    box(bounds=[(0, 0, 0), (2 * size, 2 * size, size)]).export(file)
    return Scene(
        body={"name": "slab", "mesh": str(file), "unit": "m", "max_element_size": 0.014, "refine": sizes},
        # The direct solution is linear, which scenes are not by default.
        material={"law": "linear", "youngs_modulus": SOFT.youngs_modulus, "poissons_ratio": SOFT.poissons_ratio},
        region=[{"shape": "sphere", "center": centre, "radius": radius, "youngs_modulus": MODULUS}],
        supports={"fixed": "z < min + 1mm"},
        # The direct solution knows no friction.
        tool={"radius": TOOL, "contact": "local", "friction": 0.0},
        view={"strain_limit": 0.0},
    )


def found_nodule(folder: Path, place: Point, below: float, radius: float) -> Nodule:
    """Return the foremost nodule that a grid over the top finds."""
    found = stiffness_map(slab(folder, place, below, radius), GRID, DEPTH, on="z > max - 1mm")
    return compare(found).nodules[0]


def _found(place: Point, below: float, radius: float) -> list[Check]:
    with tempfile.TemporaryDirectory() as folder:
        nodule = found_nodule(Path(folder), place, below, radius)
    what = f"ball of {1e3 * radius:g} mm, {1e3 * below:g} mm deep, found on a grid of {1e3 * GRID:g} mm"
    return [
        Check(f"{what}: {name}", 1e3 * float(at), 1e3 * truth, "where it was put", PLACE / truth, "mm")
        for name, at, truth in zip("xy", nodule.place, place, strict=False)
    ]


def _line() -> list[Point]:
    """Places along the middle of the top where elements are finer, as in the example."""
    return [(x, SIZE) for x in np.arange(0.012, 0.07, 0.007).tolist()]
