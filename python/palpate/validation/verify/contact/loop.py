"""The force loop of one body, as a user makes it, and the paths on which contact is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from palpate.body import Body
from palpate.green import GreensFunction
from palpate.scene import BodyMotion, BuiltScene, Scene
from palpate.simulation import Simulation
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.reference import top_middle, top_nodes

# A device that renders anything at once: what is measured is the law, not the safety stage.
UNLIMITED = {"max_force": 1e6, "max_slew": 1e12, "ramp": 0.0, "max_stiffness": 1e9}

# Places over the touch height from which a tool comes, and how often the height is halved to find it.
CLEAR, HALVINGS = 1e-3, 34


def sphere(radius: float, friction: float = 0.0) -> dict[str, Any]:
    """Table of a rigid sphere under the local law."""
    return {"shape": "sphere", "radius": radius, "contact": "local", "friction": friction}


def loop_of(
    body: Body,
    green: GreensFunction,
    tools: Sequence[Mapping[str, Any]],
    device: Mapping[str, Any] | None = None,
    motion: BodyMotion | None = None,
) -> Simulation:
    """Force loop with the tools of a scene's tables; ``device`` None: one without limits."""
    limits = UNLIMITED if device is None else dict(device)
    table = {"name": "body", "model": "liver"}  # the table asks for a source; the body is given
    scene = Scene(body=table, tool=[dict(tool) for tool in tools], device=limits, view={"strain_limit": 0.0})
    return Simulation(BuiltScene.of(scene, body, green, motion))


def touch_heights(simulation: Simulation, points: np.ndarray, normals: np.ndarray, around: float) -> np.ndarray:
    """Distance of the tool's centre from each point along its normal at which force begins, (n,) m, by halving.

    Every probe is a press of its own: the tool leaves the scene between them, and comes in from outside.

    Parameters
    ----------
    simulation
        A loop.
    points, normals
        (n, 3) m, and (n, 3).
    around
        A distance near the sought ones, m, right to within :data:`CLEAR`.

    """
    low, high = np.full(len(points), around - CLEAR), np.full(len(points), around + CLEAR)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        probes = np.full((len(points), 3, 3), np.nan)
        probes[:, 1] = points + (middle + 2 * CLEAR)[:, None] * normals
        probes[:, 2] = points + middle[:, None] * normals
        forces = simulation.play(probes.reshape(-1, 3)).forces.reshape(probes.shape)[:, 2]
        touching = np.linalg.norm(forces, axis=1) > 0
        low, high = np.where(touching, middle, low), np.where(touching, high, middle)
    return (low + high) / 2


def swept(simulation: Simulation, points: np.ndarray, normals: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return forces (n, 3), N, on a device that comes down to the first place and slides at heights along normals."""
    path = points + heights[:, None] * normals
    lead = path[0] + np.linspace(2 * CLEAR + 2e-3, 0, 40, endpoint=False)[:, None] * normals[0]
    return simulation.run(np.vstack([lead, path]))[len(lead) :]


def straight(start: Sequence[float], end: Sequence[float], step: float) -> np.ndarray:
    """Points (n, 3), m, from ``start`` to ``end``, about a step apart."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    count = max(2, round(np.linalg.norm(end - start) / step) + 1)
    return start + np.linspace(0, 1, count)[:, None] * (end - start)


def pressed(
    body: Body,
    tool: Mapping[str, Any],
    height: float,
    depths: np.ndarray,
    reach: float,
    green: GreensFunction | None = None,
) -> np.ndarray:
    """Return forces (n,), N, along z on a device that presses a tool into the middle of the top, ever deeper.

    The tool's origin is ``height`` over its lowest point, m; nodes within a ``reach`` of the middle may be touched.
    Without the body's Green's function it is computed.
    """
    simulation = loop_of(body, green or green_of(body, touch=top_nodes(body, reach)), [tool])
    top = top_middle(body) + (0, 0, height)
    lead = straight(top + (0, 0, 1e-3), top, 5e-5)
    return simulation.run(np.vstack([lead, top - np.outer(depths, (0, 0, 1))]))[len(lead) :, 2]
