"""Default radii of tools, proportional to the size of the body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.errors import SceneError
from palpate.green import GreensFunction
from palpate.mesh import size_text
from palpate.scene.tables import SceneTables, ToolTable
from palpate.scene.tool_shape import KEYS

# Of the longest side of a body: 5 mm on a block of 8 cm, 12 mm, a thumb, on a liver of 20 cm.
PART_OF_BODY = 1 / 16
# A tool smaller than this part of an element's edge was meant in another unit.
LEAST_OF_EDGE = 0.01


def default_radius(green: GreensFunction) -> float:
    """Radius of a tool that suits a body, m: a sixteenth of its longest side."""
    return PART_OF_BODY * float(np.ptp(green.surface_positions, axis=0).max())


def default_contact_radius(green: GreensFunction) -> float:
    """Radius of a patch that suits a body, m: that of a tool, or the largest that its surface takes."""
    return green.largest_contact_radius(default_radius(green))


def with_radii(scene: SceneTables, greens: Sequence[GreensFunction]) -> SceneTables:
    """Scene on these bodies whose tools all have their radii.

    Raises SceneError for a contact radius that covers more nodes than a tick can weigh, and a rounding wider than the
    radius. A tool larger than the bodies, or smaller than a hundredth of an element, is refused too.
    """
    for tool in scene.tools:
        _require_size(tool, greens)
    tools = [_with_radii(tool, greens) for tool in scene.tools]
    return scene if tools == scene.tools else scene.model_copy(update={"tools": tools})


def _require_size(tool: ToolTable, greens: Sequence[GreensFunction]) -> None:
    """Refuse a tool that cannot be meant for these bodies: its lengths were given in another unit."""
    given = {"radius": tool.radius, "contact_radius": tool.contact_radius, "length": tool.length}
    lengths = {name: value for name, value in given.items() if value is not None}
    if tool.semi_axes is not None:
        lengths["semi_axes"] = max(tool.semi_axes)
    largest = max(float(green.extents.max()) for green in greens)
    edge = min(green.edge_length for green in greens)
    for name, value in lengths.items():
        if value > largest:
            raise SceneError(
                f"tool.{name} is {value:.4g} m, more than the longest side of the bodies, {size_text([largest])}: give "
                f"metres, or text such as '6mm'"
            )
        if name in ("radius", "semi_axes") and value < LEAST_OF_EDGE * edge:
            raise SceneError(
                f"tool.{name} is {value:.4g} m, less than a hundredth of an element, whose edges are "
                f"{size_text([edge])}: give metres, or text such as '6mm'"
            )


def _with_radii(tool: ToolTable, greens: Sequence[GreensFunction]) -> ToolTable:
    given = {}
    if tool.radius is None and "radius" in KEYS.get(tool.shape, ({"radius"}, set()))[0]:
        given["radius"] = min(default_radius(green) for green in greens)
        if tool.rounding is not None and tool.rounding > given["radius"]:
            raise SceneError(
                f"tool.rounding is {tool.rounding:g} m, more than the radius of {given['radius']:.3g} m that follows "
                "the body: give tool.radius"
            )
    if tool.contact_radius is None:
        given["contact_radius"] = min(default_contact_radius(green) for green in greens)
        return tool.model_copy(update=given)
    if not all(green.accepts_contact_radius(tool.contact_radius) for green in greens):
        largest = min(green.largest_contact_radius(tool.contact_radius) for green in greens)
        raise SceneError(
            f"tool.contact_radius = {1e3 * tool.contact_radius:.4g} mm covers more nodes of the surface than a tick "
            f"can weigh: give at most {1e3 * largest:.3g} mm, or make the mesh coarser"
        )
    return tool.model_copy(update=given) if given else tool
