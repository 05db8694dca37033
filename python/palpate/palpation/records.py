"""Records of a palpation's results, interpolation at scattered places of a surface, and what their files share."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.atomic import written_beside
from palpate.equality import ComparedByValue
from palpate.mesh.triangles import node_normals
from palpate.palpation.sides import SurfaceShape
from palpate.scene import BuiltScene

if TYPE_CHECKING:
    import meshio

# Share of normals in the distance, by spacings; how far from the closest place values are known, in spacings: out to
# the corner of a square lattice's last cell, and over an edge half-way round.
NORMALS, KNOWN = 1.2, 1.6
NEIGHBOURS = 24
XYZ = ("x_m", "y_m", "z_m")


def joined(points: np.ndarray, normals: np.ndarray, spacing: float) -> np.ndarray:
    """Points (n, 3), m, and unit normals (n, 3) as places (n, 6), whose distances count in spacings, m."""
    return np.hstack([points / spacing, NORMALS * normals])


def interpolated(asked: np.ndarray, places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n,) at places (n, 6) of :func:`joined`, from those (p,) at others (p, 6), NaN where nothing is known.

    Interpolated by radial basis functions, `sum w_i |x - x_i| + c`, over the closest places: what was measured stands
    at its place, between places it is as smooth as that allows. Distances are those of places and normals together, so
    that the far side of a thin part, or the next side beyond an edge, takes nothing from this one. NaN where no place
    is near.
    """
    from scipy.interpolate import RBFInterpolator
    from scipy.spatial import cKDTree

    known = np.isfinite(values)
    found = np.full(len(asked), np.nan)
    if known.any():
        near = cKDTree(places[known]).query(asked)[0] < KNOWN
        if near.any():
            neighbours = min(NEIGHBOURS, int(known.sum()))
            fit = RBFInterpolator(places[known], values[known], neighbours, kernel="linear", degree=0)
            found[near] = fit(asked[near])
    return found


@dataclass(frozen=True, eq=False, repr=False)
class PressCurve(ComparedByValue):
    """Force against depth of one press, or along one stroke. Compared by value, number by number; not hashable.

    Attributes
    ----------
    time
        (t,) s, since the first tick.
    depth
        (t,) m, below zero before the touch.
    position
        (t,) m along a stroke; zeros of a press.
    force
        (t, 3) N on the tool, in the scene.
    normal_force
        (t,) N along the outward normal.
    limited
        (t,) whether the limit of strain or that of force held the tool.

    """

    time: np.ndarray
    depth: np.ndarray
    position: np.ndarray
    force: np.ndarray
    normal_force: np.ndarray
    limited: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class MapRecord(ComparedByValue):
    """What a map holds; :class:`palpate.palpation.StiffnessMap` describes each field."""

    points: np.ndarray
    normals: np.ndarray
    bodies: np.ndarray
    strokes: np.ndarray
    force: np.ndarray
    stiffness: np.ndarray
    secant_stiffness: np.ndarray
    held_by: np.ndarray
    reached_depth: np.ndarray
    reached_force: np.ndarray
    curves: tuple[PressCurve, ...]
    skipped: dict[str, int]
    spacing: float
    depth: float
    speed: float
    scene: BuiltScene = field(compare=False)
    resumed: int = field(default=0, compare=False)

    def at(self, points: np.ndarray, normals: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Stiffness (n,), N/m, interpolated at points (n, 3), m, with outward normals (n, 3); NaN far from all points.

        ``values`` (p,) takes other values at the points in its place.
        """
        known = self.stiffness if values is None else values
        places = joined(self.points, self.normals, self.spacing)
        return interpolated(joined(points, normals, self.spacing), places, known)

    def surfaces(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Of each body, in the scene: positions (s, 3), m, normals (s, 3), and triangles (t, 3) as rows of them."""
        found = []
        for body in self.scene.bodies:
            shape = SurfaceShape(body.green)
            normals = body.vectors_to_scene(node_normals(shape.positions, shape.triangles))
            found.append((body.points_to_scene(shape.positions), normals, shape.triangles))
        return found


@dataclass(frozen=True, eq=False)
class Nodule(ComparedByValue):
    """Something hidden, as it is felt. Compared by value, number by number; not hashable.

    Attributes
    ----------
    place
        (3,) m on the surface, in the scene: where the fitted bump is highest.
    body
        Number of the body.
    point
        The point of the map with the largest change.
    ratio, difference
        Of the stiffness there to that without it, and N/m more than that.
    half_width
        Distance at which half of the change is left, m.

    """

    place: np.ndarray
    body: int
    point: int
    ratio: float
    difference: float
    half_width: float


def surface_mesh(found: MapRecord, values: Mapping[str, np.ndarray]) -> meshio.Mesh:
    """Surfaces of all bodies in the scene, with values (p,) at points taken to their nodes."""
    import meshio

    positions, cells, data, of_body = [], [], {name: [] for name in values}, []
    start = 0
    for body, (places, normals, triangles) in enumerate(found.surfaces()):
        own = found.bodies == body
        for name, at_points in values.items():
            data[name].append(found.at(places, normals, np.where(own, at_points, np.nan)))
        positions.append(places)
        cells.append(("triangle", start + triangles))
        of_body.append(np.full(len(triangles), body))
        start += len(places)
    joined = {name: np.concatenate(parts) for name, parts in data.items()}
    return meshio.Mesh(np.vstack(positions), cells, point_data=joined, cell_data={"body": of_body})


def write_columns(path: Path, columns: Mapping[str, Sequence[Any]]) -> None:
    """Write columns of one length as CSV."""
    write_rows(path, columns, zip(*columns.values(), strict=True))


def write_rows(path: Path, names: Iterable[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write rows as CSV below names, numbers with nine digits; beside, then renamed."""
    with written_beside(path) as partial, partial.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_text(value) for value in row] for row in rows)


def _text(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, (float, np.floating)) else str(value)
