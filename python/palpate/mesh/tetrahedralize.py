"""Tetrahedra from a surface; the meshers run in child processes, for bad surfaces can hang or crash them."""

from __future__ import annotations

import os
import sys
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError, MeshWarning
from palpate.input_file import require_file
from palpate.mesh.child import failure_of, run_limited
from palpate.mesh.elements import face_parts
from palpate.mesh.filling import PARTS, REPAIR_HINT, Ball, Element, Filling
from palpate.mesh.size import scale_of
from palpate.mesh.stl import load_stl
from palpate.mesh.tetmesh import TetMesh
from palpate.units import length
from palpate.vectors import three_numbers

if TYPE_CHECKING:
    import trimesh

SURFACE_ENDINGS = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf")
# A part of a repaired body that is smaller than this share of the largest is none.
CRUMB = 0.01
TIME_LIMIT = 300.0  # s


def tetrahedralize(
    surface: str | os.PathLike[str] | trimesh.Trimesh,
    max_element_size: float | str | None = None,
    unit: str | None = None,
    refine: Sequence[Ball] = (),
    *,
    repair: bool = False,
    time_limit: float = TIME_LIMIT,
) -> TetMesh:
    """Fill a closed surface with 4-node tetrahedra, by NETGEN; or a broken one, by fTetWild.

    Before solving, ``.to_quadratic()`` is advised, at twice the element size: at the same price the result is several
    times more accurate.

    Parameters
    ----------
    surface
        STL, OBJ, PLY, OFF or GLB file, or a trimesh surface.
    max_element_size
        Longest edge wanted, m or text such as ``"4mm"``; None: a fifteenth of the longest side, and where the surface
        is curved so strongly or the body so thin that more than a hundredth of the volume would be lost, down to a
        sixtieth. What is lost all the same, or by the size given, a :class:`palpate.MeshWarning` tells.
    unit
        Unit of length of the surface; None: metres.
    refine
        Finer balls: ``((x, y, z), radius, size)`` in m.
    repair
        Fill what an open or self-intersecting surface most plausibly encloses, within a thousandth of its size; needs
        the ``repair`` extra.
    time_limit
        Seconds after which the mesher is stopped.

    Raises
    ------
    MeshError
        A surface that cannot be filled, with what is wrong with it, a mesher that crashed, hung or returned nothing, or
        a mesh that loses more than a tenth of the volume.
    UnclearUnitError
        No unit is given, and in metres the body is below a millimetre or above three metres long; with a unit given
        that is a warning.

    """
    return _fill(surface, max_element_size, "linear", unit, refine, repair, time_limit)


def tetrahedralize_with(
    element: Element,
    surface: str | os.PathLike[str] | trimesh.Trimesh,
    max_element_size: float | str | None = None,
    unit: str | None = None,
    refine: Sequence[Ball] = (),
    repair: bool = False,
) -> TetMesh:
    """Fill a closed surface as :func:`tetrahedralize` does, with either element; None: a size that suits it.

    The mid-side nodes of 10-node elements lie on the surface, so these may be several times larger than a curve is wide
    before they lose volume; those of a repaired surface are straight.
    """
    return _fill(surface, max_element_size, element, unit, refine, repair)


def _fill(
    surface: str | os.PathLike[str] | trimesh.Trimesh,
    max_element_size: float | str | None,
    element: Element,
    unit: str | None,
    refine: Sequence[Ball],
    repair: bool = False,
    time_limit: float = TIME_LIMIT,
) -> TetMesh:
    """Tetrahedra by NETGEN, or by fTetWild."""
    name, shape = _load(surface)
    shape = shape.copy()
    shape.apply_scale(scale_of(name, shape.vertices, unit))
    if repair:
        _check_finite(name, shape)
    else:
        _check_surface(name, shape)
    size = None if max_element_size is None else length(max_element_size)
    if size is not None and not (np.isfinite(size) and size > 0):
        raise MeshError(f"max_element_size must be positive, got {max_element_size}")
    for center, radius, ball_size in refine:
        three_numbers(center, "the centre of a ball in refine", MeshError)
        if not (np.isfinite([radius, ball_size]).all() and radius > 0 and ball_size > 0):
            raise MeshError("refine takes ((x, y, z), radius, size) with positive radius and size in metres")
    if not repair:
        return Filling(name, shape, element, size, refine, time_limit).mesh()
    if refine:
        raise MeshError("repair and refine do not go together: repair first, and mesh the result's surface again")
    extent = float(np.ptp(shape.vertices, axis=0).max())
    mesh = _repaired(name, shape, extent / PARTS[element] if size is None else size, extent, time_limit)
    return mesh.to_quadratic() if element == "quadratic" else mesh


def read_surface(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """Read a surface as it is, in its own unit.

    Raises
    ------
    MeshError
        A file that is missing or cannot be read.

    """
    return _load(path)[1]


def closed_surface(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """Read a closed surface, in its own unit.

    Raises
    ------
    MeshError
        A file that is missing or cannot be read, or a surface that is open, crossed or empty.

    """
    name, shape = _load(path)
    _check_surface(name, shape)
    return shape


def _load(surface: str | os.PathLike[str] | trimesh.Trimesh) -> tuple[str, trimesh.Trimesh]:
    import trimesh

    if isinstance(surface, trimesh.Trimesh):
        return "surface", surface
    path = Path(surface)
    require_file(path, MeshError)
    if path.suffix.lower() not in SURFACE_ENDINGS:
        raise MeshError(f"{path}: unknown surface format '{path.suffix}'; known are {', '.join(SURFACE_ENDINGS)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded = load_stl(path) if path.suffix.lower() == ".stl" else trimesh.load_mesh(path, process=False)
            shape = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
    except Exception as error:
        reason = " ".join(str(error).split())[:150]
        raise MeshError(f"{path}: cannot be read as a surface ({reason})") from None
    if not isinstance(shape, trimesh.Trimesh) or len(shape.faces) == 0:
        raise MeshError(f"{path}: holds no triangles; is it really a {path.suffix[1:].upper()} file?")
    return str(path), shape


def _check_surface(name: str, shape: trimesh.Trimesh) -> None:
    """Refuse what NETGEN would crash or hang on, and turn an inverted surface round (in place)."""
    _check_finite(name, shape)
    shape.merge_vertices(merge_tex=True, merge_norm=True)
    shape.update_faces(shape.nondegenerate_faces())
    shape.update_faces(shape.unique_faces())
    shape.remove_unreferenced_vertices()
    _, counts = np.unique(shape.edges_sorted, axis=0, return_counts=True)
    open_edges, crowded = int((counts == 1).sum()), int((counts > 2).sum())
    if open_edges:
        raise MeshError(f"{name}: the surface is not closed ({open_edges} open edges); {REPAIR_HINT}")
    if crowded:
        raise MeshError(f"{name}: {crowded} edges are shared by more than two triangles; {REPAIR_HINT}")
    if not shape.is_winding_consistent:
        raise MeshError(f"{name}: its triangles do not agree on which side is outside; {REPAIR_HINT}")
    if shape.body_count != 1:
        raise MeshError(f"{name}: holds {shape.body_count} separate surfaces, one is needed; save them one by one")
    if shape.volume < 0:
        shape.invert()
        warnings.warn(f"{name}: the surface was inside out and has been turned round", MeshWarning, stacklevel=3)
    if shape.volume <= 0:
        raise MeshError(f"{name}: the surface encloses no volume")


def _check_finite(name: str, shape: trimesh.Trimesh) -> None:
    bad = np.flatnonzero(~np.isfinite(shape.vertices).all(axis=1))
    if bad.size:
        raise MeshError(f"{name}: vertex {bad[0]} has a coordinate that is not finite")


def _without_crumbs(name: str, mesh: TetMesh) -> TetMesh:
    """Drop what fTetWild leaves hanging on edges and vertices, or beside the body: parts without a face to the rest."""
    labels = face_parts(mesh.tets)
    volumes = np.bincount(labels, mesh.volumes)
    kept = (volumes >= CRUMB * volumes.max())[labels]
    if kept.all():
        return mesh
    warnings.warn(
        f"{name}: {(~kept).sum()} tetrahedra that share no face with the rest, {mesh.volumes[~kept].sum():.2g} m3 of "
        f"{mesh.volume:.3g} m3, were dropped",
        MeshWarning,
        stacklevel=3,
    )
    used = np.unique(mesh.tets[kept])
    return TetMesh(mesh.nodes[used], np.searchsorted(used, mesh.tets[kept]), mesh.regions[kept])


def _repaired(name: str, shape: trimesh.Trimesh, size: float, extent: float, time_limit: float) -> TetMesh:
    """Mesh by fTetWild, in a unit box as NETGEN's."""
    origin = shape.vertices.min(axis=0)
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        given, made = Path(folder) / "surface.npz", Path(folder) / "mesh.npz"
        np.savez(given, vertices=(shape.vertices - origin) / extent, faces=shape.faces, size=size / extent)
        command = [sys.executable, "-m", "palpate.mesh.tetwild_child", str(given), str(made)]
        status = run_limited(command, time_limit)
        if status == 3:
            raise MeshError("repairing needs pytetwild: pip install pytetwild pyvista")
        failure = failure_of(status, time_limit)
        if failure is not None or not made.exists():
            raise MeshError(f"{name}: fTetWild {failure or 'returned no tetrahedra'}")
        with np.load(made) as result:
            mesh = _without_crumbs(name, TetMesh(result["nodes"] * extent + origin, result["tets"]))
    warnings.warn(
        f"{name}: the surface was rebuilt, within about {1e-3 * extent * 3**0.5:.2g} m of the given one",
        MeshWarning,
        stacklevel=3,
    )
    return mesh
