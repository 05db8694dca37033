"""The drawn surface of a hyperelastic body meets the tool, whatever the size of its elements."""

from __future__ import annotations

import numpy as np
import pytest

from palpate import Material
from palpate.validation.verify.benchmark import green_of
from palpate.validation.verify.contact.loop import loop_of, sphere
from palpate.validation.verify.contact.reference import Block, body_on_table, top_nodes

RADIUS, LENGTH, TOP = 6e-3, 18e-3, 0.05
# Between the nodes, which are 6.25 mm apart.
PLACE = np.array([0.048, 0.0525, TOP])
# Across the tool's own axis z.
LYING = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
TOOLS = {
    "sphere": sphere(RADIUS),
    "capsule": {"shape": "capsule", "radius": RADIUS, "length": LENGTH, "contact": "local", "friction": 0.0},
    "punch": {"shape": "punch", "radius": RADIUS, "rounding": 1.5e-3, "contact": "local", "friction": 0.0},
}
# Points of a triangle, barycentric.
INSIDE = np.array([(i, j, 8 - i - j) for i in range(9) for j in range(9 - i)]) / 8


def body_of(law: str):
    return body_on_table(Block(material=Material("10kPa", 0.45, law=law)), (8, 8, 4), quadratic=True)


@pytest.fixture(scope="module")
def greens():
    return {law: (body := body_of(law), green_of(body, touch=top_nodes(body))) for law in ("neo-hookean", "linear")}


def pressed(greens, law: str, tool: str, depth: float) -> np.ndarray:
    """Displacements (s, 3), m, of the surface under a tool at a depth."""
    body, green = greens[law]
    simulation = loop_of(body, green, [TOOLS[tool]])
    lowest = 0.0 if tool == "punch" else RADIUS
    path = PLACE + (lowest - np.arange(-5e-4, depth + 1e-9, 1e-4))[:, None] * [0.0, 0.0, 1.0]
    turned = np.tile(LYING if tool == "capsule" else (1.0, 0.0, 0.0, 0.0), (len(path), 1))
    recording = simulation.play(path, turned, watch=green.surface_nodes)
    return recording.displacements[-1]


def distances(tool: str, origin: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distances of points (..., 3) from a tool at an origin, m; those of a punch above its rim are infinite."""
    away = points - origin
    if tool == "sphere":
        return np.linalg.norm(away, axis=-1) - RADIUS
    if tool == "capsule":
        along = np.clip(away[..., 0], 0.0, LENGTH)
        return np.linalg.norm(away - along[..., None] * [1.0, 0.0, 0.0], axis=-1) - RADIUS
    return np.where(np.linalg.norm(away[..., :2], axis=-1) < RADIUS - 1.5e-3, -away[..., 2], np.inf)


@pytest.mark.quick(3)
@pytest.mark.parametrize("depth", [1e-3, 3e-3, 6e-3, 10e-3])
@pytest.mark.parametrize("tool", TOOLS)
def test_the_drawn_surface_of_a_hyperelastic_body_meets_the_tool(greens, tool, depth):
    """The patch alone leaves three fifths of a press between both: the tool would be hidden inside of the body.

    A sphere does so all over, but for the sagitta of flat triangles between nodes on it. Longer and flat tools do below
    their middle: elements of 12 mm do not follow a rim.
    """
    _, green = greens["neo-hookean"]
    moved = pressed(greens, "neo-hookean", tool, depth)
    places = green.surface_positions + moved
    triangles = np.searchsorted(green.surface_nodes, green.surface_triangles)
    origin = PLACE - (0.0, 0.0, depth - (0.0 if tool == "punch" else RADIUS))
    drawn = np.einsum("si,tij->tsj", INSIDE, places[triangles]).reshape(-1, 3)
    middle = PLACE[0] + (LENGTH / 2 if tool == "capsule" else 0.0)
    below = np.linalg.norm(drawn[:, :2] - (middle, PLACE[1]), axis=1) < (np.inf if tool == "sphere" else 1e-3)
    nearest = distances(tool, origin, drawn[below]).min()
    assert -0.15 * depth < nearest < 0.05 * depth, f"{1e3 * nearest:.2f} mm"
    assert distances(tool, origin, places).min() > -1e-5 - 0.02 * depth


def test_far_from_the_tool_the_surface_is_that_of_the_force_alone(greens):
    """Displacements are proportional to the force, everywhere if the law is linear; supports do not move."""
    for law in ("linear", "neo-hookean"):
        body, green = greens[law]
        shallow, deep = (pressed(greens, law, "sphere", depth) for depth in (1e-3, 6e-3))
        far = np.linalg.norm(green.surface_positions - PLACE, axis=1) > (0.03 if law == "neo-hookean" else 0.0)
        factor = np.linalg.norm(deep[far]) / np.linalg.norm(shallow[far])
        assert np.linalg.norm(deep[far] - factor * shallow[far]) < 0.01 * np.linalg.norm(deep[far])
        assert not deep[np.isin(green.surface_nodes, body.fixed_nodes)].any()
