"""Detection of parts too thin for the half-space of the local contact law."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.scene import BuiltBody, ToolTable
from palpate.simulation.frame import Contact

# From this thickness on, over the tool's radius, a layer on a table is as accurate as a block: docs/accuracy.md.
THICK = 1.5


def thin_places(contacts: Sequence[Contact], tools: Sequence[ToolTable], bodies: Sequence[BuiltBody]) -> list[bool]:
    """For each tool whether it touches a part, under the local law, that is thinner than 1.5 of its radii."""
    thin = [False] * len(tools)
    for contact in contacts:
        if contact.radius > 0 and not thin[contact.tool]:
            green, thickness = bodies[contact.body].green, THICK * size(tools[contact.tool])
            thin[contact.tool] = green.is_thin_at(contact._own_point, contact._own_normal, thickness)
    return thin


def size(tool: ToolTable) -> float:
    """Radius of a tool, m; of an ellipsoid the smallest semi-axis."""
    return min(tool.semi_axes) if tool.semi_axes is not None else tool.radius or 0.0
