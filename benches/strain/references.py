"""Forces of a sphere of 10 mm on cylinders at finite strain: blocks, layers, columns, domes, plates, random bodies.

They are what tests and docs/accuracy.md compare the force loop with; `tests/data/large_strain.json` has them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benches.strain.axisymmetric import Cylinder, Sphere, forces, graded
from benches.strain.materials import Material, NeoHookean, ReducedPolynomial
from palpate.progress import status_line

RADIUS, MODULUS = 0.01, 10e3
# Sizes of elements below the sphere over its radius: with the first, Newton's method does not find the contact of one
# body at all, and sizes around it give forces that differ by 0.2 %. Growth outwards, longest step over the radius.
FINE, GROWTH, STEP = (1 / 9, 1 / 10), 1.4, 0.12
SEEDS, DRAWN, PRESSES = (20240611, 20261126), 25, 8
# Largest depth of bodies drawn by chance: over the height, over that of a plate, and in m.
MOST, MOST_OF_PLATE, DEEPEST = 0.4, 1.2, 0.015
OUT = Path(__file__).parents[2] / "tests/data/large_strain.json"


def material(law: str, nu: float) -> Material:
    """Return a material of the references."""
    if law == "neo-hookean":
        return NeoHookean(MODULUS, nu)
    if law == "yeoh":
        return ReducedPolynomial(MODULUS, nu, 0.0, 0.5)
    return ReducedPolynomial(MODULUS, nu, 0.5)


def _case(name: str, size: tuple[float, float], nu: float, support: str, depths: Any, law: str = "neo-hookean") -> dict:
    radius, height = size
    keys = {"name": name, "radius": radius, "height": height, "nu": nu, "support": support, "law": law}
    return keys | {"depths": [float(depth) for depth in depths]}


def cases() -> list[dict]:
    """Return the bodies, and depths in m."""
    found = []
    for nu in (0.3, 0.45, 0.49):
        for h in (0.025, 0.05):
            found.append(_case(f"block {h} {nu}", (0.1, h), nu, "table", np.array([0.1, 0.2, 0.3]) * h))
        found.append(_case(f"column {nu}", (0.025, 0.05), nu, "bonded", [0.005, 0.01, 0.015]))
    for t in (0.01, 0.015):
        found.append(_case(f"layer {t}", (0.06, t), 0.45, "bonded", np.array([0.1, 0.2, 0.3, 0.4]) * t))
    for nu in (0.3, 0.45):
        for name, curvature in (("dome", 1 / 0.04), ("hollow", -1 / 0.06)):
            depths = [0.0025, 0.005, 0.01, 0.015]
            found.append(_case(f"{name} {nu}", (0.05, 0.05), nu, "bonded", depths) | {"curvature": curvature})
    found.append(_case("plate", (0.05, 0.01), 0.45, "rim", [0.0025, 0.005, 0.01, 0.015]))
    for first, seed in enumerate(SEEDS):
        rng = np.random.default_rng(seed)
        found += [_drawn(rng, f"random {first * DRAWN + k}") for k in range(DRAWN)]
    return found


def _drawn(rng: np.random.Generator, name: str) -> dict:
    support = ["table", "bonded", "bonded", "rim"][rng.integers(4)]
    plate = support == "rim"
    height = float(rng.uniform(0.01, 0.03) if plate else np.exp(rng.uniform(np.log(0.014), np.log(0.07))))
    radius = float(np.exp(rng.uniform(np.log(0.025), np.log(0.08))))
    nu = float(rng.choice([0.3, 0.4, 0.45, 0.47, 0.49]))
    law = str(rng.choice(["neo-hookean"] * 4 + ["mooney-rivlin", "yeoh"]))
    nu = nu if law == "neo-hookean" else min(nu, 0.45)
    deepest = min((MOST_OF_PLATE if plate else MOST) * height, DEEPEST)
    depths = np.sort(rng.uniform(0.05, 1.0, PRESSES)) * deepest
    return _case(name, (radius, height), nu, support, depths, law)


def solved(case: dict) -> dict:
    """Return a case with the forces, N, down to where Newton's method converges.

    Raises
    ------
    RuntimeError
        It does not converge at the least depth.

    """
    for fine in FINE:
        found = _solved_with(case, fine * RADIUS)
        if found["forces"]:
            return found
    raise RuntimeError(f"{case['name']}: Newton's method converges at no depth: try other sizes of elements")


def _solved_with(case: dict, fine: float) -> dict:
    """Solve with elements of a size, m, below the sphere."""
    radius, height, support = case["radius"], case["height"], case["support"]
    r = graded(fine, min(1.4 * RADIUS, 0.7 * radius), GROWTH, radius)
    z = graded(fine, min(0.9 * RADIUS, 0.5 * height), GROWTH, height)
    rim = support == "rim"
    curvature = case.get("curvature", 0.0)
    body = Cylinder(r, -z, material(case["law"], case["nu"]), support != "table", rim, rim, curvature)
    depths = np.array(case["depths"])
    between = np.arange(0.1, depths.max() / RADIUS, STEP) * RADIUS
    between = between[np.abs(between[:, None] - depths).min(1) > 0.03 * RADIUS]
    path = np.unique(np.concatenate([depths, between]))
    found = forces(body, Sphere(RADIUS), path)
    reached = depths <= path[: len(found)].max(initial=0.0)
    asked = found[np.searchsorted(path[: len(found)], depths[reached])]
    return {**case, "depths": depths[reached].tolist(), "forces": asked.tolist()}


def strain_references(out: Annotated[Path, typer.Option(help="File of the results.")] = OUT) -> None:
    """Solve the bodies that are missing in the file of results; a quarter of an hour for all.

    Example: python -m benches strain-references
    """
    found = json.loads(out.read_text()) if out.exists() else {}
    for case in cases():
        if case["name"] not in found:
            with status_line(case["name"]):
                found[case["name"]] = solved(case)
            out.write_text(json.dumps(found, indent=1) + "\n")
    print(f"wrote {out}")
