"""What a tool looks like: which keys each shape takes, and the surface of one from a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.mesh.tetrahedralize import SURFACE_ENDINGS, closed_surface
from palpate.units import length_scale

if TYPE_CHECKING:
    from palpate.scene.tables import ToolTable

# Keys of each shape beside those of every tool, and those of them that it cannot do without.
KEYS = {
    "sphere": ({"radius"}, set()),
    "ellipsoid": ({"semi_axes"}, {"semi_axes"}),
    "capsule": ({"radius", "length"}, {"length"}),
    "punch": ({"radius", "rounding"}, set()),
}
KEYS_OF_FILES: tuple[set[str], set[str]] = ({"unit"}, set())
# Part of its radius by which the rim of a punch is rounded where nothing is said.
ROUNDING = 0.1

# Kind, three lengths (m), and of a surface its vertices (m) and triangles.
ShapeArguments = tuple[str, tuple[float, float, float], list[list[float]], list[list[int]]]


def check_keys(tool: ToolTable) -> None:
    """Refuse keys that the shape does not take, and a law that knows spheres only.

    Raises
    ------
    ValueError
        What is wrong, and which keys the shape takes.

    """
    name = tool.shape
    if name not in KEYS and Path(name).suffix.lower() not in SURFACE_ENDINGS:
        known = ", ".join(f"'{key}'" for key in KEYS)
        raise ValueError(f"unknown shape '{name}'; known are {known} and surface files ({', '.join(SURFACE_ENDINGS)})")
    taken, needed = KEYS.get(name, KEYS_OF_FILES)
    of_shapes = set().union(*(keys for keys, _ in KEYS.values()), KEYS_OF_FILES[0])
    for key in sorted(tool.model_fields_set & of_shapes - taken):
        raise ValueError(f"a tool of shape '{name}' takes no '{key}'; it takes {', '.join(sorted(taken))}")
    for key in sorted(needed - tool.model_fields_set):
        raise ValueError(f"a tool of shape '{name}' needs the key '{key}'")
    if tool.rounding is not None and tool.rounding > tool.radius:
        raise ValueError(f"rounding is {tool.rounding:g} m, more than the radius of {tool.radius:g} m")
    if name != "sphere" and tool.contact != "local":
        raise ValueError(f"contact = '{tool.contact}' is for spheres: a tool of shape '{name}' takes 'local'")


def shape_arguments(tool: ToolTable, folder: Path) -> ShapeArguments:
    """Read the surface file, if there is one, and put the shape as the force loop takes it.

    Raises
    ------
    MeshError
        A file that is missing, cannot be read or holds no closed surface.

    """
    if tool.shape == "sphere":
        return "sphere", (tool.radius, 0.0, 0.0), [], []
    if tool.shape == "ellipsoid" and tool.semi_axes is not None:
        return "ellipsoid", tool.semi_axes, [], []
    if tool.shape == "capsule":
        return "capsule", (tool.radius, tool.length or 0.0, 0.0), [], []
    if tool.shape == "punch":
        return "punch", (tool.radius, tool.rounding or ROUNDING * tool.radius, 0.0), [], []
    surface = closed_surface(folder / tool.shape)
    vertices = np.asarray(surface.vertices, dtype=float) * length_scale(tool.unit)
    return "surface", (0.0, 0.0, 0.0), vertices.tolist(), np.asarray(surface.faces).tolist()
