"""What follows from the size of a body: default radii of tools, and the part that is touched first of large ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.body import Body, SurfaceRegion
from palpate.errors import SceneError
from palpate.green import GreensFunction, Plan, plan
from palpate.green.job import Job
from palpate.mesh import size_text
from palpate.scene.mistakes import located
from palpate.scene.tables import SceneTables, ToolTable
from palpate.scene.tool_shape import KEYS

# Of the longest side of a body: 5 mm on a block of 8 cm, 12 mm, a thumb, on a liver of 20 cm.
PART_OF_BODY = 1 / 16
# A tool smaller than this part of an element's edge was meant in another unit.
LEAST_OF_EDGE = 0.01
# A body that takes longer than this, s, is touched first within this part of its longest side.
LONG, FIRST_SHARE = 20.0, 0.15
# Towards the viewer, as the page shows a body at first: DEFAULT_DIRECTION of viewer/src/scene/viewport.ts.
TOWARDS_VIEWER = (0.45, -1.0, 0.62)


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


@dataclass(frozen=True)
class Expected:
    """What computing a body comes to."""

    # Of the body.
    nodes: int
    surface_nodes: int
    plan: Plan | None  # None for a body whose store is there
    # Centre, m, and radius, m, of the ball that is computed first; None where all of it is soon done.
    first: tuple[tuple[float, float, float], float] | None = None

    @classmethod
    def of(
        cls,
        body: Body,
        precision: str | None = None,
        touch: SurfaceRegion | None = None,
        first: SurfaceRegion | None = None,
        radii: Sequence[float] = (),
    ) -> Expected:
        """Look for the store of a body, or plan it, with the arguments of :func:`palpate.plan`.

        Raises Error for a body that cannot be computed, or files without room.
        """
        counts = len(body.mesh.nodes), len(body.mesh.surface_nodes)
        if Job.of(body, precision, touch, first, None).stored() is not None:
            return cls(*counts, None)
        planned = plan(body, precision=precision, touch=touch, first=first, radii=radii)
        if planned.seconds < LONG:
            return cls(*counts, planned)
        longest = float(np.ptp(body.mesh.nodes[body.mesh.surface_nodes], axis=0).max())
        return cls(*counts, planned, (seen_middle(body), FIRST_SHARE * longest))

    def __str__(self) -> str:
        """One line for people, and one for each series; empty for a body whose store is there."""
        planned = self.plan
        if planned is None:
            return ""
        size, seconds = planned.store / 1e6, max(planned.seconds, 1.0)
        columns = (
            f"computing {planned.columns} columns: at most {size:.3g} MB in the cache, about {seconds:.0f} s "
            f"({self.nodes:,} nodes, {self.surface_nodes:,} on the surface)"
        )
        return "\n".join([columns, *map(str, planned.series)])


def pressing_radii(scene: SceneTables, body: Body) -> list[float]:
    """Radii, m, of the spheres of a scene that press a body under the local law; by the body where none is given."""
    spheres = [tool for tool in scene.tools if tool.contact == "local" and tool.shape == "sphere"]
    longest = float(np.ptp(body.mesh.nodes[body.mesh.surface_nodes], axis=0).max())
    return sorted({PART_OF_BODY * longest if tool.radius is None else float(tool.radius) for tool in spheres})


def seen_middle(body: Body) -> tuple[float, float, float]:
    """Surface node that the page first shows in the middle, (3,) m; where that is held, the highest node."""
    numbers = body.mesh.surface_nodes
    nodes = body.mesh.nodes[numbers]
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    towards = np.array(TOWARDS_VIEWER) / np.linalg.norm(TOWARDS_VIEWER)
    offsets = nodes - 0.5 * (low + high)
    along = offsets @ towards
    aside = np.linalg.norm(offsets - along[:, None] * towards, axis=1)
    # The nearest to the viewer of those beside the line of sight: the others are behind it.
    beside = np.flatnonzero(aside <= max(0.5 * FIRST_SHARE * float((high - low).max()), float(aside.min())))
    chosen = int(beside[along[beside].argmax()])
    if np.isin(numbers[chosen], body.fixed_nodes):
        chosen = int(nodes[:, 2].argmax())
    x, y, z = nodes[chosen].tolist()
    return x, y, z
