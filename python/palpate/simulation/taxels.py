"""Where the taxels of a tool lie."""

from __future__ import annotations

import numpy as np

from palpate.errors import SceneError
from palpate.scene.tables import SceneTables, ToolTable


def taxel_sides(scene: SceneTables, sides: tuple[float, float] | None) -> list[tuple[float, float]]:
    """Width along x and height along y of the grid of each tool, m: those given, or as large as the tool seen along z.

    Raises SceneError for a tool whose law has no pressures.
    """
    for rank, tool in enumerate(scene.tools):
        if tool.contact != "local":
            raise SceneError(
                f"taxels need pressures, which contact = '{tool.contact}' of tool {rank} has not: give it 'local'"
            )
    return [sides or _width_of(tool, scene) for tool in scene.tools]


def _width_of(tool: ToolTable, scene: SceneTables) -> tuple[float, float]:
    kind, lengths, vertices, _ = tool.shape_arguments(scene.folder)
    if kind == "surface":
        width, height = 2.0 * np.abs(np.array(vertices)[:, :2]).max(axis=0)
        return float(width), float(height)
    return 2.0 * lengths[0], 2.0 * lengths[1 if kind == "ellipsoid" else 0]
