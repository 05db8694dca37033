"""Default radii of tools, proportional to the size of the body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from palpate.errors import SceneError
from palpate.green import GreensFunction
from palpate.mesh import size_text
from palpate.scene.mistakes import located
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
    largest = max(float(green.extents.max()) for green in greens)
    require_tool_sizes(scene, largest, min(green.edge_length for green in greens))
    tools = [_with_radii(tool, greens) for tool in scene.tools]
    return scene if tools == scene.tools else scene.model_copy(update={"tools": tools})


def require_tool_sizes(scene: SceneTables, largest: float, edge: float | None = None) -> None:
    """Refuse tools that cannot be meant for these bodies: their lengths were given in another unit.

    ``largest`` is the longest side of the bodies, ``edge`` the shortest edge of their elements, m, where it is known.
    The SceneError names the line of a scene that is a file.
    """
    path, text = scene.source
    for rank, tool in enumerate(scene.tools):
        for name, mistake in _mistaken_lengths(tool, largest, edge):
            where = f"{located(path, text, ['tool', rank, name])}: " if text else ""
            raise SceneError(f"{where}{mistake}: give metres, or text such as '6mm'")


def _mistaken_lengths(tool: ToolTable, largest: float, edge: float | None) -> Iterator[tuple[str, str]]:
    """Keys of a tool whose lengths do not suit the bodies, and why."""
    given = {"radius": tool.radius, "contact_radius": tool.contact_radius, "length": tool.length}
    lengths = {name: value for name, value in given.items() if value is not None}
    if tool.semi_axes is not None:
        lengths["semi_axes"] = max(tool.semi_axes)
    for name, value in lengths.items():
        if value > largest:
            what = f"tool.{name} is {value:.4g} m, more than the longest side of the bodies"
            yield name, f"{what}, {size_text([largest])}"
        if edge is not None and name in ("radius", "semi_axes") and value < LEAST_OF_EDGE * edge:
            what = f"tool.{name} is {value:.4g} m, less than a hundredth of an element"
            yield name, f"{what}, whose edges are {size_text([edge])}"


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
