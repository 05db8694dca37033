"""Protocol of a palpation: spacing, depth and speed, and the points that it visits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate import units
from palpate.body import parse
from palpate.errors import SceneError
from palpate.mesh import size_text
from palpate.palpation.sides import MOST_POINTS, SurfaceShape, evenly_on, lattice_on, too_many
from palpate.simulation import Simulation
from palpate.vectors import brief, three_numbers

# Ticks that a press takes at least: the slope is that of a parabola through the last fifth of them.
FEWEST_TICKS = 20
# A point that is given by hand lies at most this part of the body's longest side off the surface.
OFF_SURFACE = 0.05

NOT_TOUCHABLE, BY_A_SUPPORT, BY_AN_EDGE = "not touchable", "by a support", "by an edge"


@dataclass(frozen=True)
class Protocol:
    """A palpation."""

    spacing: float  # of the points, m
    depth: float  # from first touch to the deepest point of a press, m
    speed: float  # of a press, m/s, or along a stroke
    strokes: bool = False  # whether lines are slid over instead of pressing on points

    @classmethod
    def of(cls, spacing: float | str, depth: float | str, speed: float | str, strokes: bool) -> Protocol:
        """Take numbers in SI, or text with units; Error for a number that is not positive, or no quantity."""
        given = {"grid": units.length(spacing), "depth": units.length(depth), "speed": units.speed(speed)}
        for name, value in given.items():
            if not (np.isfinite(value) and value > 0):
                raise SceneError(f"the {name} of a palpation must be positive, got {value:g}")
        return cls(*given.values(), strokes)

    def check(self, simulation: Simulation) -> None:
        """Refuse what the first tool of a scene cannot do.

        Raises SceneError for a depth beyond the tool's own radius, or a speed at which a press has too few ticks.
        """
        tool, rate = simulation.scene.tools[0], simulation.scene.device.rate
        if 0 < tool.reach <= self.depth:
            raise SceneError(
                f"a depth of {1e3 * self.depth:.3g} mm is beyond the tool, whose radius is {1e3 * tool.reach:.3g} mm"
            )
        if not self.strokes and self.depth / self.speed * rate < FEWEST_TICKS:
            fastest = self.depth * rate / FEWEST_TICKS
            raise SceneError(
                f"at {1e3 * self.speed:.3g} mm/s a press of {1e3 * self.depth:.3g} mm takes fewer than {FEWEST_TICKS}"
                f" ticks of {1e3 / rate:g} ms: press with at most {1e3 * fastest:.3g} mm/s"
            )


@dataclass(frozen=True)
class Sites:
    """Where a palpation presses, in the scene."""

    # (p, 3) m on the surface that tools meet, and outward unit normals (p, 3).
    points: np.ndarray
    normals: np.ndarray
    bodies: np.ndarray  # (p,) numbers of their bodies
    skipped: dict[str, int] = field(default_factory=dict)  # points left out, by reason


class Selection:
    """Which places of the bodies of a scene are palpated; what is left out is counted.

    A place is left out where a node of its triangle may not be touched, and where a support or a sharp edge is closer
    than the contact is wide, `sqrt(R d)` of a sphere. ``on`` is a predicate over places in a body's own frame; None
    takes all. Raises SceneError for a spacing wider than every body.
    """

    def __init__(self, simulation: Simulation, protocol: Protocol, on: str | None):
        self.shapes = [SurfaceShape(body.green) for body in simulation.bodies]
        largest = max(self.shapes, key=lambda shape: shape.extents.max()).extents
        if protocol.spacing > largest.max():
            raise SceneError(
                f"a grid of {1e3 * protocol.spacing:.3g} mm is wider than the body of {size_text(largest)}"
            )
        self._on, self._holds = on, None if on is None else parse(on)
        self._distance = contact_radius(simulation, protocol.depth)
        self._skipped = dict.fromkeys((NOT_TOUCHABLE, BY_A_SUPPORT, BY_AN_EDGE), 0)

    def mask(self, body: int, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """Mask (p,) of the places to be palpated, of points (p, 3), m, on triangles (p,) of a body, in its frame."""
        shape, kept = self.shapes[body], np.ones(len(points), dtype=bool)
        if self._holds is not None:
            # Nodes tell what min and max are.
            kept = np.asarray(self._holds(np.vstack([points, shape.positions])))[: len(points)].copy()
        for reason, found in (
            (BY_A_SUPPORT, shape.by_a_support(points, triangles, self._distance)),
            (NOT_TOUCHABLE, ~shape.may_be_touched(triangles)),
            (BY_AN_EDGE, shape.by_an_edge(points, self._distance)),
        ):
            self._skipped[reason] += int((kept & found).sum())
            kept &= ~found
        return kept

    @property
    def excluded(self) -> dict[str, int]:
        """Places left out, by reason."""
        return {reason: count for reason, count in self._skipped.items() if count}

    def no_sites_message(self, what: str) -> str:
        """Message where no place is left."""
        where = "" if self._on is None else f" where {self._on}"
        reasons = ", ".join(f"{count} {reason}" for reason, count in self.excluded.items())
        return f"{what}{where}: " + (
            f"left out are {reasons}; try a narrower grid" if reasons else "no part of the surface"
        )


def sample_sites(simulation: Simulation, protocol: Protocol, on: str | None) -> Sites:
    """Points about a spacing apart on all bodies of a scene, where a predicate holds in the body's own frame.

    Raises SceneError for a spacing wider than every body, one that is far too small, or no point at all.
    """
    selection = Selection(simulation, protocol, on)
    found = []
    for body, shape in enumerate(selection.shapes):
        parts = [(lattice_on if side.is_flat else evenly_on)(side, protocol.spacing) for side in shape.sides]
        points = np.concatenate([part.points for part in parts])
        kept = selection.mask(body, points, np.concatenate([part.triangles for part in parts]))
        found.append(closest(simulation, body, simulation.bodies[body].points_to_scene(points[kept]))[:2])
    points, normals = (np.concatenate(part) for part in zip(*found, strict=True))
    if len(points) > MOST_POINTS:
        raise too_many(len(points), protocol.spacing)
    if len(points) == 0:
        raise SceneError(selection.no_sites_message("no point to press"))
    bodies = np.repeat(np.arange(len(found)), [len(part[0]) for part in found])
    return Sites(points, normals, bodies, selection.excluded)


def sites_at_points(simulation: Simulation, points: Sequence[Any]) -> Sites:
    """Points that are given, in the scene, m, moved onto the closest surface.

    Raises SceneError for something else than points, or one that is far from every body.
    """
    asked = np.array([three_numbers(point, "a point of a palpation", SceneError, units.length) for point in points])
    if len(asked) == 0:
        raise SceneError("a palpation needs at least one point")
    found = [closest(simulation, body, asked) for body in range(len(simulation.bodies))]
    distances = np.array([np.abs(distance) for _, _, distance in found])
    bodies = distances.argmin(axis=0)
    size = max(body.green.extents.max() for body in simulation.bodies)
    far = np.flatnonzero(distances.min(axis=0) > OFF_SURFACE * size)
    if len(far):
        raise SceneError(f"the point {brief(asked[far[0]])} m lies on no body")
    rank = np.arange(len(asked))
    feet, normals = (np.array([part[k] for part in found])[bodies, rank] for k in (0, 1))
    return Sites(feet, normals, bodies)


def closest(simulation: Simulation, body: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, normals and distances as of :meth:`palpate.Simulation.closest`, for tools of any law.

    Tools that stick meet the flat triangles: their normals are interpolated between the nodes.
    """
    feet, normals, distances = simulation.closest(points, body)
    if np.isfinite(distances).all():
        return feet, normals, distances
    from trimesh import Trimesh
    from trimesh.triangles import closest_point, points_to_barycentric

    shape, placed = SurfaceShape(simulation.bodies[body].green), simulation.bodies[body]
    own = placed.points_to_body(points)
    corners = shape.positions[shape.triangles]
    node_normals = Trimesh(shape.positions, shape.triangles, process=False).vertex_normals
    feet, normals = np.empty((len(own), 3)), np.empty((len(own), 3))
    for rank, point in enumerate(own):
        near = closest_point(corners, np.broadcast_to(point, (len(corners), 3)))
        triangle = int(np.linalg.norm(near - point, axis=1).argmin())
        feet[rank] = near[triangle]
        weights = points_to_barycentric(corners[triangle][None], feet[rank][None])[0]
        normal = weights @ node_normals[shape.triangles[triangle]]
        normals[rank] = normal / np.linalg.norm(normal)
    distances = np.einsum("ij,ij->i", own - feet, normals)
    return placed.points_to_scene(feet), placed.vectors_to_scene(normals), distances


def contact_radius(simulation: Simulation, depth: float) -> float:
    """Radius, m, of the first tool's contact at a depth on a flat surface, `sqrt(R d)`, `R` that of its front."""
    tool = simulation.scene.tools[0]
    radius = tool.radius or (max(tool.semi_axes[:2]) ** 2 / tool.semi_axes[2] if tool.semi_axes else depth)
    return radius if tool.shape == "punch" else float(np.sqrt(radius * depth))
