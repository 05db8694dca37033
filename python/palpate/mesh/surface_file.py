"""Surface files as triangles, with the names of the parts that a file has."""

from __future__ import annotations

import contextlib
import logging
import os
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError
from palpate.input_file import require_file
from palpate.mesh.cut_short import require_whole
from palpate.mesh.ply import has_strips, read_ply
from palpate.mesh.stl import load_stl, read_stl

if TYPE_CHECKING:
    import trimesh

SURFACE_ENDINGS = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf")


@dataclass(frozen=True, eq=False)
class SurfaceFile:
    """Triangles of a file in its own unit of length, not checked."""

    name: str  # of the surface in messages
    shape: trimesh.Trimesh
    # Names of the meshes that the file holds, where it names several, and for each triangle the index of its own.
    part_names: tuple[str, ...] = ()
    part_of_face: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


def load_surface(surface: str | os.PathLike[str] | trimesh.Trimesh | SurfaceFile) -> SurfaceFile:
    """Read a file, or take a surface of a program, or one that was read.

    Raises MeshError for a file that is missing, cut short, cannot be read, or holds no triangles.
    """
    import trimesh

    if isinstance(surface, SurfaceFile):
        return surface
    if isinstance(surface, trimesh.Trimesh):
        if len(surface.faces) == 0:
            raise MeshError("surface: holds no triangles")
        return SurfaceFile("surface", surface)
    path = Path(surface)
    require_file(path, MeshError)
    if path.suffix.lower() not in SURFACE_ENDINGS:
        raise MeshError(f"{path}: unknown surface format '{path.suffix}'; known are {', '.join(SURFACE_ENDINGS)}")
    reasons = []
    for read in _readers(path):
        try:
            with _silence():
                found = read(path)
        except Exception as error:
            reasons.append(" ".join(str(error).split())[:150] or type(error).__name__)
            continue
        if len(found.shape.faces) > 0:
            require_whole(path, len(found.shape.faces))
            return found
    if reasons:
        raise MeshError(f"{path}: cannot be read as a surface ({reasons[-1]})")
    raise MeshError(f"{path}: holds no triangles; is it really a file in {path.suffix[1:].upper()} format?")


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep a library's warnings, and its log with tracebacks of what it got over, from the terminal."""
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)


def _readers(path: Path) -> list[Callable[[Path], SurfaceFile]]:
    """Ways to read a file, the first that finds triangles is taken."""
    ending = path.suffix.lower()
    if ending == ".stl":
        return [lambda path: _of_scene(path, load_stl(path)), lambda path: _of_arrays(path, *read_stl(path))]
    plain = [_by_trimesh, _without_materials]
    if ending == ".ply":
        own = lambda path: _of_arrays(path, *read_ply(path))  # noqa: E731
        return [own] if has_strips(path) else [*plain, own]
    return plain


def _by_trimesh(path: Path) -> SurfaceFile:
    import trimesh

    return _of_scene(path, trimesh.load_scene(path, process=False))


def _without_materials(path: Path) -> SurfaceFile:
    """Read a file whose textures or materials are missing or damaged."""
    import trimesh

    return _of_scene(path, trimesh.load_scene(path, process=False, skip_materials=True))


def _of_arrays(path: Path, vertices: np.ndarray, faces: np.ndarray) -> SurfaceFile:
    import trimesh

    return SurfaceFile(str(path), trimesh.Trimesh(vertices, faces, process=False))


def _of_scene(path: Path, loaded: trimesh.Trimesh | trimesh.Scene) -> SurfaceFile:
    """All triangles of a scene where its transforms place them, and the names of its nodes."""
    import trimesh

    if isinstance(loaded, trimesh.Trimesh):
        return SurfaceFile(str(path), loaded)
    placed = []
    for node in loaded.graph.nodes_geometry:
        transform, geometry = loaded.graph[node]
        mesh = loaded.geometry[geometry]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) > 0:
            placed.append((str(node), transform, mesh))
    if len(placed) == 1 and np.array_equal(placed[0][1], np.eye(4)):
        return SurfaceFile(str(path), placed[0][2])
    points, faces, of_face, first = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], [np.empty(0, dtype=int)], 0
    for rank, (_, transform, mesh) in enumerate(placed):
        # A transform that mirrors turns triangles round.
        own = mesh.faces if np.linalg.det(transform[:3, :3]) > 0 else mesh.faces[:, ::-1]
        points.append(trimesh.transform_points(mesh.vertices, transform))
        faces.append(own + first)
        of_face.append(np.full(len(own), rank))
        first += len(mesh.vertices)
    shape = trimesh.Trimesh(np.concatenate(points), np.concatenate(faces), process=False)
    return SurfaceFile(str(path), shape, tuple(name for name, *_ in placed), np.concatenate(of_face))
