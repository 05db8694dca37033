"""The files of a palpation: CSV, VTU, PNG, each written beside its place and renamed."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.atomic import written_beside
from palpate.fields import write_result
from palpate.figures import write_figure
from palpate.palpation.pictures import picture_of_curves, picture_of_detection, picture_of_map
from palpate.palpation.records import DetectionRecord, MapRecord

if TYPE_CHECKING:
    import meshio

XYZ = ("x_m", "y_m", "z_m")
DETECTION_FILES = ("detection.csv", "nodules.csv", "detection.vtu", "detection.png")


def save_map(found: MapRecord, folder: Path) -> list[Path]:
    """See :meth:`StiffnessMap.save`."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ("points.csv", "curves.csv", "curves.png", "stiffness.vtu", "stiffness.png")
    points, curves, curves_picture, surface, picture = paths = [folder / name for name in names]
    write_points(found, points)
    write_curves(found, curves)
    write_figure(picture_of_curves(found), curves_picture, grid=False)
    write_result(mesh_of_map(found), surface)
    write_figure(picture_of_map(found), picture, grid=False)
    return paths


def save_detection(detection: DetectionRecord, folder: Path) -> list[Path]:
    """See :meth:`Detection.save`."""
    folder.mkdir(parents=True, exist_ok=True)
    table, nodules, surface, picture = paths = [folder / name for name in DETECTION_FILES]
    found = detection.found
    columns = {
        "point": np.arange(len(found.points)),
        **dict(zip(XYZ, found.points.T, strict=True)),
        "stiffness_N_per_m": found.stiffness,
        "plain_stiffness_N_per_m": detection.plain.stiffness,
        "ratio": detection.ratio,
        "difference_N_per_m": detection.difference,
    }
    _write_rows(table, columns, zip(*columns.values(), strict=True))
    names = ("body", *XYZ, "ratio", "difference_N_per_m", "half_width_m", "point")
    rows = ((n.body, *n.place, n.ratio, n.difference, n.half_width, n.point) for n in detection.nodules)
    _write_rows(nodules, names, rows)
    write_result(mesh_of_detection(detection), surface)
    write_figure(picture_of_detection(detection), picture, grid=False)
    return paths


def write_points(found: MapRecord, path: Path) -> None:
    """Write a row for each point."""
    columns = {
        "point": np.arange(len(found.points)),
        "body": found.bodies,
        "stroke": found.strokes,
        **dict(zip(XYZ, found.points.T, strict=True)),
        **dict(zip(("normal_x", "normal_y", "normal_z"), found.normals.T, strict=True)),
        "force_N": found.force,
        "stiffness_N_per_m": found.stiffness,
        "secant_stiffness_N_per_m": found.secant_stiffness,
        "held_by": found.held_by,
        "reached_depth_m": found.reached_depth,
        "reached_force_N": found.reached_force,
    }
    _write_rows(path, columns, zip(*columns.values(), strict=True))


def write_curves(found: MapRecord, path: Path) -> None:
    """Write a row for each tick of each curve, with the number of its point or stroke."""
    of = "stroke" if (found.strokes >= 0).any() else "point"
    names = (of, "time_s", "position_m", "depth_m", "normal_force_N", "fx_N", "fy_N", "fz_N", "limited")
    with written_beside(path) as partial, partial.open("w", encoding="utf-8") as stream:
        stream.write(",".join(names) + "\n")
        for rank, curve in enumerate(found.curves):
            count = np.full(len(curve.time), rank)
            moved = (curve.time, curve.position, curve.depth, curve.normal_force, *curve.force.T)
            formats = ["%d", *["%.9g"] * len(moved), "%d"]
            np.savetxt(stream, np.column_stack([count, *moved, curve.limited]), delimiter=",", fmt=formats)


def mesh_of_map(found: MapRecord, **more: np.ndarray) -> meshio.Mesh:
    """See :meth:`StiffnessMap.to_meshio`."""
    return _surface_mesh(found, {"stiffness": found.stiffness, "secant_stiffness": found.secant_stiffness, **more})


def mesh_of_detection(detection: DetectionRecord) -> meshio.Mesh:
    """See :meth:`Detection.to_meshio`."""
    more = {"plain_stiffness": detection.plain.stiffness, "difference": detection.difference, "ratio": detection.ratio}
    return mesh_of_map(detection.found, **more)


def _surface_mesh(found: MapRecord, values: Mapping[str, np.ndarray]) -> meshio.Mesh:
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


def _write_rows(path: Path, names: Iterable[str], rows: Iterable[Sequence[Any]]) -> None:
    with written_beside(path) as partial, partial.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_text(value) for value in row] for row in rows)


def _text(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, (float, np.floating)) else str(value)
