"""Surface files as triangles, with the names of the parts that a file has."""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError
from palpate.input_file import quiet, reason_text, require_file
from palpate.mesh.own_readers import has_strips, load_stl, read_ply, read_stl

if TYPE_CHECKING:
    import trimesh

SURFACE_ENDINGS = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf")
# What every writer ends an STL text with; some write "end solid".
_END_OF_STL = re.compile(rb"\bend[ \t]*solid\b", re.IGNORECASE)
# A header of PLY, or the first line of OFF that is no comment, is shorter than this.
HEAD, TAIL = 4096, 4096


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
            with quiet("trimesh"):
                found = read(path)
        except Exception as error:
            reasons.append(reason_text(error))
            continue
        if len(found.shape.faces) > 0:
            require_whole(path, len(found.shape.faces))
            return found
    if reasons:
        raise MeshError(f"{path}: cannot be read as a surface ({reasons[-1]})")
    raise MeshError(f"{path}: holds no triangles; is it really a file in {path.suffix[1:].upper()} format?")


def _readers(path: Path) -> list[Callable[[Path], SurfaceFile]]:
    """Ways to read a file, the first that finds triangles is taken."""
    ending = path.suffix.lower()
    if ending == ".stl":
        return [lambda path: _of_scene(path, load_stl(path)), lambda path: _of_arrays(path, *read_stl(path))]
    # Textures or materials may be missing or damaged.
    plain = [_by_trimesh, functools.partial(_by_trimesh, skip_materials=True)]
    if ending == ".ply":
        own = lambda path: _of_arrays(path, *read_ply(path))  # noqa: E731
        return [own] if has_strips(path) else [*plain, own]
    return plain


def _by_trimesh(path: Path, **options: bool) -> SurfaceFile:
    import trimesh

    return _of_scene(path, trimesh.load_scene(path, process=False, **options))


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


def require_whole(path: Path, triangles: int) -> None:
    """Raise MeshError for a file with fewer faces than its header counts, or an STL text without its end.

    An interrupted copy or a full disk leaves such files.
    Polygons are cut into triangles, so that a whole file has at least as many ``triangles``, which were read, as faces.
    Binary files are refused by their readers.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
        file.seek(-min(TAIL, path.stat().st_size), 2)
        tail = file.read()
    faces = _declared_faces(path.suffix.lower(), head)
    if triangles < faces:
        raise MeshError(f"{path}: it is cut short: its header counts {faces} faces, {triangles} are there")
    is_text = head[:5].lower() == b"solid" and b"\0" not in head
    if path.suffix.lower() == ".stl" and is_text and not _END_OF_STL.search(tail):
        raise MeshError(
            f"{path}: it is cut short: 'endsolid' is missing after {triangles} triangles; copy it again, or add that "
            "line if it is whole"
        )


def _declared_faces(ending: str, head: bytes) -> int:
    """Return how many faces a header of PLY or OFF counts, 0 where there is none."""
    if ending == ".ply":
        found = re.search(rb"^element[ \t]+face[ \t]+(\d+)", head, re.MULTILINE)
        return int(found.group(1)) if found else 0
    if ending == ".off":
        words = re.sub(rb"#[^\n]*", b"", head).split()
        return int(words[2]) if len(words) > 2 and words[0].upper().endswith(b"OFF") and words[2].isdigit() else 0
    return 0
