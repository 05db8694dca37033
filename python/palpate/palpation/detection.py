"""Detection of hidden nodules: stiffness of a body beside that of the same body of one material.

Both are palpated alike, so the shape of the body, its supports and what a mesh is off drop out of the ratio. A nodule
is a peak of `|ratio - 1|`; its place is that of the bump `A / (1 + r^2 / w^2)^2` fitted to the points around in the
tangent plane, by least squares. The bump has the shape of what a small inclusion at depth `w` changes: strain under a
press falls off as `1 / (r^2 + w^2)`, and the change goes with its square (to first order; the width is fitted).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.body import Body
from palpate.equality import ComparedByValue
from palpate.errors import SceneError
from palpate.fields import write_result
from palpate.figures import write_figure
from palpate.mesh import size_text
from palpate.palpation import pictures
from palpate.palpation.protocol import Protocol, Sites, closest
from palpate.palpation.records import XYZ, Nodule, surface_mesh, write_columns, write_rows
from palpate.palpation.runs import probe
from palpate.palpation.stiffness_map import StiffnessMap, palpated
from palpate.scene import BuiltScene, Scene
from palpate.scene.regions import MaterialTable, RegionTable
from palpate.scene.tables import SceneTables
from palpate.simulation import Simulation
from palpate.units import count_text

if TYPE_CHECKING:
    import meshio
    from matplotlib.figure import Figure

# Of what was a region to what is around it: far less than a store's own rounding.
UNFELT = 1e-9
# A change below this, or below this part of the largest, is no nodule. Fingers tell about a tenth apart.
LEAST_CHANGE, LEAST_PART = 0.02, 0.25
# A peak is the largest within so many spacings, and is fitted within as many; fewest points of a fit; least cosine of
# the angle between normals there.
AROUND, FEWEST, SAME_SIDE = 2.5, 6, 0.5
# Surfaces that lie farther apart than this part of the body's longest side are not of the same body.
SAME_SURFACE = 0.01
DETECTION_FILES = ("detection.csv", "nodules.csv", "detection.vtu", "detection.png")


@dataclass(frozen=True, eq=False, repr=False)
class Detection(ComparedByValue):
    """A map beside that of a body without anything hidden. Compared by value, number by number; not hashable.

    Attributes
    ----------
    found, plain
        Both maps, at the same points.
    ratio, difference
        (p,) stiffness over that of the plain body, and N/m more than it; NaN where one of them is not known.
    nodules
        Peaks, the largest change first.

    """

    found: StiffnessMap
    plain: StiffnessMap
    ratio: np.ndarray
    difference: np.ndarray
    nodules: tuple[Nodule, ...]

    def __repr__(self) -> str:
        count = count_text(len(self.nodules), "nodule")
        known = self.ratio[np.isfinite(self.ratio)]
        range_text = f", ratios {known.min():.3g} to {known.max():.3g}" if len(known) else ""
        return f"Detection({count}{range_text})"

    def to_meshio(self) -> meshio.Mesh:
        """Give :meth:`StiffnessMap.to_meshio` with ``plain_stiffness``, ``difference``, N/m, and ``ratio``."""
        found, plain = self.found, self.plain
        maps = {"stiffness": found.stiffness, "secant_stiffness": found.secant_stiffness}
        compared = {"plain_stiffness": plain.stiffness, "difference": self.difference, "ratio": self.ratio}
        return surface_mesh(found, maps | compared)

    def plot(self) -> Figure:
        """Picture of the ratio on the surface with the nodules, as a figure of matplotlib."""
        return pictures.picture_of_ratio(self.found, self.ratio, self.nodules)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write it into a folder, which is made.

        Returns
        -------
        list
            The files: ``detection.csv``, ``nodules.csv``, ``detection.vtu``, ``detection.png``.

        """
        where, found = Path(folder), self.found
        where.mkdir(parents=True, exist_ok=True)
        table, nodules, surface, picture = paths = [where / name for name in DETECTION_FILES]
        columns = {
            "point": np.arange(len(found.points)),
            **dict(zip(XYZ, found.points.T, strict=True)),
            "stiffness_N_per_m": found.stiffness,
            "plain_stiffness_N_per_m": self.plain.stiffness,
            "ratio": self.ratio,
            "difference_N_per_m": self.difference,
        }
        write_columns(table, columns)
        names = ("body", *XYZ, "ratio", "difference_N_per_m", "half_width_m", "point")
        rows = ((n.body, *n.place, n.ratio, n.difference, n.half_width, n.point) for n in self.nodules)
        write_rows(nodules, names, rows)
        write_result(self.to_meshio(), surface)
        write_figure(self.plot(), picture, grid=False)
        return paths


def homogeneous(scene: SceneTables) -> SceneTables | None:
    """Scene whose regions are all of the material around them; None where there are none.

    Regions stay, :data:`UNFELT` stiffer. The law of contact extrapolates the compliance of a body of several materials
    from two widths, that of one material from one (docs/theory.md). On coarse elements beside an edge these are up to 7
    % apart. Both bodies are so looked at alike.
    """

    def imperceptible_regions(regions: list[RegionTable], base: MaterialTable) -> list[RegionTable]:
        same = {**base.model_dump(), "youngs_modulus": base.youngs_modulus * (1 + UNFELT)}
        return [region.model_copy(update=same) for region in regions]

    if not any(scene.region if body.region is None else body.region for body in scene.bodies):
        return None
    bodies = [
        body.model_copy(update={"region": imperceptible_regions(body.region, body.material or scene.material)})
        if body.region
        else body
        for body in scene.bodies
    ]
    return scene.model_copy(update={"region": imperceptible_regions(scene.region, scene.material), "bodies": bodies})


def compare(
    found: StiffnessMap,
    against: Scene | BuiltScene | None = None,
    *,
    partial: str | os.PathLike[str] | None = None,
    progress: bool | Callable[[int, int], None] = False,
) -> Detection:
    """Palpate another scene at the points of a map, and find the differences.

    Parameters
    ----------
    found
        The map.
    against
        A scene with bodies of the same shape in the same places; None takes the map's own, all regions of the material
        around them.
    partial, progress
        As of :func:`palpate.palpation.stiffness_map`.

    Raises
    ------
    SceneError
        Bodies of one material, where nothing is given to compare with; or bodies of another shape.

    """
    if against is None:
        plain = homogeneous(found.scene.scene)
        if plain is None:
            raise SceneError("the bodies are of one material each: give a scene to compare with")
        against = Scene.build(plain, progress=progress)
    built = against if isinstance(against, BuiltScene) else against.build(progress=progress)
    # The tool and the device are those of the map: what differs is the bodies.
    ours = found.scene.scene
    tools = [tool.in_folder(ours.folder) for tool in ours.tools]
    scene = built.scene.model_copy(update={"tools": tools, "device": ours.device, "view": ours.view})
    built = replace(built, scene=scene)
    simulation = Simulation(probe(built))
    protocol = Protocol(found.spacing, found.depth, found.speed, bool((found.strokes >= 0).any()))
    sites = _same_sites(simulation, found)
    strokes = [np.flatnonzero(found.strokes == rank) for rank in range(found.strokes.max() + 1)]
    where = None if partial is None else Path(partial)
    plain_map = palpated(built, simulation, protocol, sites, strokes, where, progress)
    ratio, difference = found.stiffness / plain_map.stiffness, found.stiffness - plain_map.stiffness
    return Detection(found, plain_map, ratio, difference, _nodules(found, simulation, ratio, difference))


def has_several_materials(body: Body | None) -> bool:
    """Whether stiffness differs within a body; a bare store does not hold that."""
    return body is not None and len(np.unique(body.element_materials[:, :2], axis=0)) > 1


def _same_sites(simulation: Simulation, found: StiffnessMap) -> Sites:
    """Points of a map on the bodies of another scene."""
    if found.bodies.max() >= len(simulation.bodies):
        raise SceneError(
            f"the scene to compare with has {len(simulation.bodies)} bodies, the map {found.bodies.max() + 1}"
        )
    points, normals = found.points.copy(), found.normals.copy()
    for body in np.unique(found.bodies):
        own = found.bodies == body
        points[own], normals[own], off = closest(simulation, body, found.points[own])
        size = simulation.bodies[body].green.extents.max()
        if not np.abs(off).max() < SAME_SURFACE * size:
            raise SceneError(
                f"the body {simulation.bodies[body].name} to compare with has another shape: its surface lies up to "
                f"{size_text([np.abs(off).max()])} off the points of the map"
            )
    return Sites(points, normals, found.bodies)


def _nodules(
    found: StiffnessMap, simulation: Simulation, ratio: np.ndarray, difference: np.ndarray
) -> tuple[Nodule, ...]:
    """Peaks of the change, each with the bump that fits it."""
    from scipy.spatial import cKDTree

    change = np.abs(np.nan_to_num(ratio - 1))
    least = max(LEAST_CHANGE, LEAST_PART * change.max(initial=0.0))
    reach = AROUND * found.spacing
    peaks = []
    for rank, near in enumerate(cKDTree(found.points).query_ball_point(found.points, reach)):
        around = np.array([k for k in near if found.normals[k] @ found.normals[rank] > SAME_SIDE])
        # Of equal ones the first.
        if change[rank] >= least and around[change[around] == change[around].max()].min() == rank:
            place, half_width = _bump(found, rank, around[np.isfinite(ratio[around])], ratio - 1)
            body = int(found.bodies[rank])
            foot = closest(simulation, body, place[None])[0][0]
            peaks.append(Nodule(foot, body, rank, float(ratio[rank]), float(difference[rank]), half_width))
    return tuple(sorted(peaks, key=lambda peak: -abs(peak.ratio - 1)))


def _bump(found: StiffnessMap, peak: int, around: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, float]:
    """Place (3,), m, and half-width at half height, m, of the bump through the changes around a peak.

    Too few points are answered by their weighted mean.
    """
    from scipy.optimize import least_squares

    up, origin, spacing = found.normals[peak], found.points[peak], found.spacing
    first = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    first /= np.linalg.norm(first)
    axes = np.array([first, np.cross(up, first)])
    places = (found.points[around] - origin) @ axes.T / spacing
    values = change[around] / change[peak]
    if len(around) < FEWEST:
        weights = np.maximum(values, 0.0)
        return origin + spacing * (weights @ places / weights.sum()) @ axes, spacing

    def off(parameters: np.ndarray) -> np.ndarray:
        height, x, y, width = parameters
        return height / (1 + ((places - (x, y)) ** 2).sum(axis=1) / width**2) ** 2 - values

    bounds = ([0.5, -1, -1, 0.2], [3.0, 1, 1, 10.0])
    _, x, y, width = least_squares(off, [1.0, 0.0, 0.0, 1.0], bounds=bounds).x
    half = width * np.sqrt(np.sqrt(2) - 1)
    return origin + spacing * np.array([x, y]) @ axes, float(spacing * half)
