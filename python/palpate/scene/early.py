"""Early touch of bodies that take long to compute: the middle of the picture is computed first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.body import Body, SurfaceRegion
from palpate.green import Plan, plan
from palpate.green.job import Job
from palpate.scene.default_radius import PART_OF_BODY
from palpate.scene.tables import SceneTables

# A body that takes longer than this, s, is touched first within this part of its longest side.
LONG, FIRST_SHARE = 20.0, 0.15
# Towards the viewer, as the page shows a body at first: DEFAULT_DIRECTION of viewer/src/scene/viewport.ts.
TOWARDS_VIEWER = (0.45, -1.0, 0.62)


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
