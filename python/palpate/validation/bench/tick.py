"""Cost of every kind of tick, over the number of nodes under a contact.

A force loop is as good as its costliest tick, so each kind has a row of its own: no contact, one that begins, holds and
ends, a second one that begins beside the first, and both; of a body at rest and of one in motion. Presses are scripted
at many places of a body with curved 10-node tetrahedra, each several times; the shortest time at a place is its cost
without what other programs add, and the costliest place is what counts. Times are those of whole ticks, safety stage,
hand-off and log included.

Beside them stands a plain copy of all entries of ``Psi`` between the nodes of the largest of the patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from palpate import _native, models
from palpate.body import Body, Material
from palpate.green import GreensFunction, precompute
from palpate.scene import YOUNGS_MODULUS, BodyMotion, BuiltScene, Scene
from palpate.simulation import Simulation

MODEL = "liver"
# Nodes that a patch should have in the middle, and how many of the surface's nodes are tried to find the radius.
SIZES, TRIED = (10, 30, 100), 60
# Places that are pressed, and how often each.
PLACES, TIMES = 40, 6
TOOL_RADIUS, CLEAR, DEPTH = 8e-3, 4e-3, 1e-3
GATHERS = 50
# Ticks of a press of one tool: outside, begins, holds, holds, leaves. A second one begins and leaves within the first.
PRESS = ("free", "begin", "hold", "hold", "end")
PAIR = ("free", "begin", "second begins", "two hold", "second ends", "end")


@dataclass(frozen=True)
class Row:
    """One kind of tick, us.

    Attributes
    ----------
    nodes
        Nodes under a contact, the median of the places.
    radius
        Contact radius, m.
    motion
        Whether the body moves.
    kind
        Of tick.
    mean, costliest
        Over the places, and of the costliest one.
    gather
        Plain copy of the entries between the nodes of the largest patch, us; None where none is read.

    """

    nodes: int
    radius: float
    motion: bool
    kind: str
    mean: float
    costliest: float
    gather: float | None


def run(sizes: Sequence[int] = SIZES, modes: int = 200) -> list[Row]:
    """Measure all kinds of ticks on the built-in liver, at rest and in motion by so many modes."""
    mesh = models.load(MODEL)
    body = Body(mesh, material=Material(YOUNGS_MODULUS[MODEL], 0.45), fixed=models.fixed(MODEL, mesh))
    green = precompute(body, progress=False)
    rows = []
    for size in sizes:
        radius = _radius_for(green, size)
        for motion in (None, _motion(body, modes)):
            rows += _rows(body, green, radius, motion)
    return rows


def as_json(rows: Sequence[Row]) -> list[dict]:
    """Rows as JSON."""
    return [asdict(row) for row in rows]


def _motion(body: Body, modes: int) -> BodyMotion:
    scene = Scene(body={"model": MODEL}, dynamics={"modes": modes})
    assert scene.dynamics is not None
    return scene.dynamics.build(body, scene.device.max_stiffness, progress=False)


def _radius_for(green: GreensFunction, size: int) -> float:
    """Contact radius whose patches have so many nodes in the middle."""
    points = _places(green, TRIED)[0]
    low, high = 0.0, float(np.ptp(green.surface_positions, axis=0).max())
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        try:
            found = np.median([len(_patch(green, point, middle)) for point in points])
        except Exception:
            found = np.inf  # more than a tick can weigh
        low, high = (middle, high) if found < size else (low, middle)
    return low


def _patch(green: GreensFunction, point: np.ndarray, radius: float) -> np.ndarray:
    return _native.contact_patch(green._core, tuple(point), radius)[0]


def _places(green: GreensFunction, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres of free triangles and their outward normals, (count, 3) each."""
    corners = green.surface_positions[np.searchsorted(green.surface_nodes, green.surface_triangles)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    free = np.flatnonzero(~np.isin(green.surface_triangles, green.fixed_nodes).any(axis=1))
    chosen = np.random.default_rng(1).choice(free, count, replace=False)
    return corners[chosen].mean(axis=1), normals[chosen] / np.linalg.norm(normals[chosen], axis=1)[:, None]


def _rows(body: Body, green: GreensFunction, radius: float, motion: BodyMotion | None) -> list[Row]:
    tool = {"radius": TOOL_RADIUS, "contact_radius": radius}
    scene = Scene(body={"model": MODEL}, tool=[tool, tool], view={"strain_limit": 0.0})
    simulation = Simulation(BuiltScene.of(scene, body, green, motion))
    points, normals = _places(green, PLACES)
    patches = [_patch(green, point, radius) for point in points]
    nodes = int(np.median([len(patch) for patch in patches]))
    largest = max(patches, key=len)
    gather = green._core.gather_us(largest.tolist(), GATHERS)
    out, pressed = points + (TOOL_RADIUS + CLEAR) * normals, points + (TOOL_RADIUS - DEPTH) * normals
    away = np.full_like(out, np.nan)
    others = np.roll(np.arange(PLACES), 1)
    one = [(out, away), (pressed, away), (pressed, away), (pressed, away), (out, away)]
    two = [(out, out[others]), (pressed, out[others]), *2 * [(pressed, pressed[others])]]
    two += [(pressed, out[others]), (out, away)]
    costs = {**_costs(simulation, two, PAIR), **_costs(simulation, one, PRESS)}
    reads = {"begin", "second begins"}
    return [
        Row(
            nodes,
            radius,
            motion is not None,
            kind,
            float(cost.mean()),
            float(cost.max()),
            gather if kind in reads else None,
        )
        for kind, cost in costs.items()
    ]


def _costs(simulation: Simulation, ticks: Sequence[tuple], kinds: Sequence[str]) -> dict[str, np.ndarray]:
    """Shortest time of each kind of tick at each place, us; every press ends with the tools out of the scene."""
    rest = np.full((PLACES, 2, 3), np.nan)
    press = np.stack([*(np.stack(tick, axis=1) for tick in ticks), rest], axis=1)
    path = np.ascontiguousarray(np.repeat(press, TIMES, axis=0).reshape(-1, 2, 3))
    upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*path.shape[:2], 4)).copy()
    raw = simulation._core.run(path, upright, np.zeros(path.shape[:2], dtype=bool), ([], []), None)
    times = 1e-3 * np.array(raw["compute_ns"], dtype=float).reshape(PLACES, TIMES, len(ticks) + 1)
    shortest = times.min(axis=1)
    return {
        kind: shortest[:, [i for i, k in enumerate(kinds) if k == kind]].max(axis=1) for kind in dict.fromkeys(kinds)
    }
