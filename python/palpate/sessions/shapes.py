"""Surfaces of tools and of the arrow of a force, to be drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from palpate.scene.tool_shape import ShapeTable
from palpate.simulation import Simulation

# Divisions of a circle.
SECTIONS = 24
# Length of a punch over its radius, as the page draws it.
PUNCH_LENGTH = 2.0
# Of an arrow of length one.
SHAFT_RADIUS, HEAD_RADIUS, HEAD_LENGTH = 0.025, 0.06, 0.2
# Length of the arrow of the largest force over the longest side of the bodies.
ARROW_PART = 0.35


def tool_surface(tool: ShapeTable, folder: Path) -> trimesh.Trimesh:
    """Surface of a tool in its own frame, m."""
    kind, lengths, vertices, triangles = tool.shape_arguments(folder)
    if kind == "surface":
        return trimesh.Trimesh(vertices, triangles)
    if kind == "capsule":
        radius, length = lengths[:2]
        capsule_shape = trimesh.creation.capsule(length, radius, count=[SECTIONS, SECTIONS])
        capsule_shape.apply_translation(
            [0, 0, -radius - capsule_shape.bounds[0, 2]]
        )  # the front hemisphere's middle is the origin
        return capsule_shape
    if kind == "punch":
        radius, rounding = lengths[:2]
        angle = np.linspace(0, np.pi / 2, 6)
        rim = np.column_stack([radius - rounding + rounding * np.sin(angle), rounding * (1 - np.cos(angle))])
        top = PUNCH_LENGTH * radius
        line = [[0.0, 0.0], *rim.tolist(), [radius, top], [0.0, top]]
        return trimesh.creation.revolve(line, sections=SECTIONS)
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    sphere.apply_scale(lengths if kind == "ellipsoid" else lengths[0])
    return sphere


def tools_of(simulation: Simulation) -> list[trimesh.Trimesh]:
    """Surfaces of the tools of a simulation in their own frames."""
    return [tool_surface(tool, simulation.scene.folder) for tool in simulation.scene.tools]


def arrow() -> trimesh.Trimesh:
    """Arrow of length one along z, from the origin."""
    neck = 1.0 - HEAD_LENGTH
    line = [[0, 0], [SHAFT_RADIUS, 0], [SHAFT_RADIUS, neck], [HEAD_RADIUS, neck], [0, 1]]
    return trimesh.creation.revolve(line, sections=12)


def arrow_scale(simulation: Simulation, forces: np.ndarray) -> float:
    """Length of arrows, m/N, for the forces (..., 3) of a session."""
    largest = np.linalg.norm(forces, axis=-1).max(initial=0.0)
    return ARROW_PART * longest_side(simulation) / largest if largest > 0 else 0.0


def longest_side(simulation: Simulation) -> float:
    """Longest side of the box around the bodies, m."""
    places = [body.points_to_scene(body.green.surface_positions) for body in simulation.bodies]
    return float(np.ptp(np.vstack(places), axis=0).max())
