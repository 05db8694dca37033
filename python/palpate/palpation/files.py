"""What the files of a palpation have in common: rows of CSV, and the surfaces with values at their nodes."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.atomic import written_beside
from palpate.palpation.records import MapRecord

if TYPE_CHECKING:
    import meshio

XYZ = ("x_m", "y_m", "z_m")


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
