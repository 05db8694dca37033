"""Triangles of inner boundaries for fTetWild: simplified, and away from the outer surface and from each other.

Lengths in parts of the longest side of the surface. Used in the mesher's own process only.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import igl
import numpy as np
from manifold3d import Error, Manifold, Mesh

Triangles = tuple[np.ndarray, np.ndarray]

# By simplifying, a boundary moves by at most this part of the size of its elements.
SIMPLIFIED = 0.03
# Two boundaries that are nearer than this part of the size of their elements count as one: between them fTetWild would
# make elements as thin. The outer one stays; among inner ones the later, which counts where they overlap.
CLEAR = 0.25


def inner_triangles(
    vertices: np.ndarray, faces: np.ndarray, inner: Sequence[tuple[np.ndarray, np.ndarray, float]]
) -> Triangles | None:
    """Triangles (n, 3), (k, 3) of inner boundaries, each with the size of its elements; None where none is left."""
    shells: list[Triangles] = []
    for own_vertices, own_faces, size in reversed(inner):
        points, triangles = np.ascontiguousarray(own_vertices), np.ascontiguousarray(own_faces, dtype=np.int64)
        with contextlib.suppress(ValueError):
            points, triangles = simplified(points, triangles, SIMPLIFIED * size)
        clear = within_surface(points, vertices, faces)
        for other in ((vertices, faces), *shells):
            squared = igl.point_mesh_squared_distance(points, np.ascontiguousarray(other[0]), other[1])[0]
            clear &= np.asarray(squared).ravel() > (CLEAR * size) ** 2
        # Those that reach into the band by a corner stay: a gap no wider than a triangle is closed by the elements.
        triangles = triangles[clear[triangles].sum(axis=1) >= 2]
        if len(triangles):
            used = np.unique(triangles)
            shells.append((points[used], np.searchsorted(used, triangles)))
    if not shells:
        return None
    starts = np.cumsum([0, *(len(points) for points, _ in shells)])
    moved = [triangles + start for (_, triangles), start in zip(shells, starts, strict=False)]
    return np.vstack([points for points, _ in shells]), np.vstack(moved)


def within_surface(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Whether points (k, 3) lie within closed triangles, by their winding number."""
    winding = igl.fast_winding_number(
        np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64), np.ascontiguousarray(points)
    )
    return np.abs(np.asarray(winding).ravel()) > 0.5


def simplified(vertices: np.ndarray, faces: np.ndarray, moved: float) -> Triangles:
    """Fewer triangles that lie at most this far off; ValueError for triangles that bound no manifold, and why."""
    solid = Manifold(Mesh(np.asarray(vertices, dtype=np.float32), np.asarray(faces, dtype=np.uint32)))
    if solid.status() != Error.NoError:
        raise ValueError(str(solid.status()))
    simple = solid.simplify(moved).to_mesh()
    points = np.asarray(simple.vert_properties, dtype=np.float64)[:, :3]
    return np.ascontiguousarray(points), np.asarray(simple.tri_verts, dtype=np.int64)
