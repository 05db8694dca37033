"""Stiffness maps of a palpation as fields of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.errors import ViewerError
from palpate.input_file import require_file
from palpate.scene import BuiltBody, BuiltScene

# Nodes of the file and of a body are the same within this part of the body's longest side.
SAME_PLACE = 1e-6


@dataclass(frozen=True)
class SurfaceMap:
    """Values at the surface nodes of a body, which a pose does not change."""

    stiffness: np.ndarray  # (s,) N/m, NaN where nothing was palpated
    change: np.ndarray | None = None  # (s,) per cent more than the plain body's; None of a map without it


def read_map(path: Path, built: BuiltScene) -> list[SurfaceMap | None]:
    """Read ``stiffness.vtu`` or ``detection.vtu`` for the bodies of a scene; None for one that it does not hold.

    Raises ViewerError for a file that is missing, cannot be read, is no map, or one of other bodies.
    """
    import meshio

    require_file(path, ViewerError)
    try:
        mesh = (meshio.vtk if path.suffix.lower() == ".vtk" else meshio.vtu).read(path)
    except (Exception, SystemExit) as error:  # meshio raises anything, and exits on what it does not know
        raise ViewerError(
            f"{path}: not a map that can be read: {str(error).splitlines()[0] if str(error) else 'damaged'}"
        ) from None
    if "stiffness" not in mesh.point_data:
        raise ViewerError(f"{path}: no map: it has no point data 'stiffness'; 'palpate map' writes stiffness.vtu")
    maps = [_of_body(body, np.asarray(mesh.points), mesh.point_data) for body in built.bodies]
    if not any(maps):
        raise ViewerError(f"{path}: a map of another body: its points are not the nodes of this surface")
    return maps


def _of_body(body: BuiltBody, points: np.ndarray, data: Mapping[str, np.ndarray]) -> SurfaceMap | None:
    from scipy.spatial import cKDTree

    green = body.green
    places = body.points_to_scene(green.surface_positions + green.free_displacements)
    off, ranks = cKDTree(points).query(places)
    if off.max() > SAME_PLACE * green.extents.max():
        return None
    stiffness = np.asarray(data["stiffness"], dtype=float)[ranks]
    if not np.isfinite(stiffness).any():
        return None
    ratio = data.get("ratio")
    return SurfaceMap(stiffness, None if ratio is None else 100 * (np.asarray(ratio, dtype=float)[ranks] - 1))


def maps_per_body(maps: Sequence[SurfaceMap | None] | None, bodies: int) -> Sequence[SurfaceMap | None]:
    """One for each body."""
    return [None] * bodies if maps is None else maps
