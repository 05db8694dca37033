"""Tool shapes that the page offers, and their data for drawing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from palpate.scene.tables import ToolTable
from palpate.scene.tool_shape import KEYS, ShapeTable
from palpate.viewer.shown_body import title_of

# What a tool of any surface file is called in messages.
SURFACE = "surface"
TITLES = {"sphere": "Sphere", "ellipsoid": "Finger pad", "capsule": "Stylus side", "punch": "Flat punch"}
# Sizes over the tool's radius. A finger's pad is flat across and longer than it is wide; a stylus is a slender rod.
PAD_SEMI_AXES = (1.6, 1.2, 1.0)
STYLUS_RADIUS, STYLUS_LENGTH = 0.5, 3.0
PUNCH_ROUNDING = 0.3


def kind_of(tool: ShapeTable) -> str:
    """Name of a tool's shape in messages."""
    return tool.shape if tool.shape in KEYS else SURFACE


def shape_choices(own: ToolTable) -> list[dict[str, str]]:
    """Entries of the page's list of shapes, for a tool of a scene. Its own shape is always among them."""
    offered = dict(TITLES) if own.contact == "local" else {}
    kind = kind_of(own)
    offered.setdefault(kind, TITLES.get(kind) or title_of(Path(own.shape).stem))
    return [{"name": name, "title": title} for name, title in offered.items()]


def with_shape(own: ToolTable, kind: str, folder: Path) -> ToolTable:
    """Return a scene's tool with an offered shape: its own as the scene has it, another in the size of its radius."""
    if kind == kind_of(own):
        return own
    radius = radius_of(own, folder)
    sizes: dict[str, dict[str, Any]] = {
        "sphere": {"radius": radius},
        "ellipsoid": {"semi_axes": tuple(part * radius for part in PAD_SEMI_AXES)},
        "capsule": {"radius": STYLUS_RADIUS * radius, "length": STYLUS_LENGTH * radius},
        "punch": {"radius": radius, "rounding": PUNCH_ROUNDING * radius},
    }
    others = {key: getattr(own, key) for key in set(ToolTable.model_fields) - set(ShapeTable.model_fields)}
    return ToolTable(shape=kind, **sizes[kind], **others)


def radius_of(tool: ShapeTable, folder: Path) -> float:
    """Half of a tool's smallest extent, m: of a sphere, a capsule and a punch the radius."""
    kind, lengths, vertices, _ = tool.shape_arguments(folder)
    if kind == "surface":
        return 0.5 * float(np.ptp(np.array(vertices), axis=0).min())
    return min(lengths) if kind == "ellipsoid" else lengths[0]


def outline(tool: ShapeTable, folder: Path) -> tuple[dict[str, Any], dict[str, tuple[str, np.ndarray]]]:
    """Return the entries of the scene message about a tool's shape, and its arrays, empty but for surface files."""
    kind, lengths, vertices, triangles = tool.shape_arguments(folder)
    header = {"shape": kind, "lengths": list(lengths), "radius": radius_of(tool, folder)}
    places, corners = np.array(vertices, dtype=float), np.array(triangles, dtype=np.uint32)
    return header, {"vertices": ("f4", places.reshape(-1, 3)), "triangles": ("u4", corners.reshape(-1, 3))}
