"""Areas and normals of flat triangles, normals at the nodes that they join, and closest points on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate import _native


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """Vectors (..., 3), m^2, across triangles (..., 3, 3), m, counter-clockwise round them, as long as their areas."""
    a, b, c = np.moveaxis(corners, -2, 0)
    return np.cross(b - a, c - a) / 2


def areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Areas (k,) of triangles (k, 3)."""
    return np.linalg.norm(area_vectors(vertices[faces]), axis=1)


def units(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length one along others; those of length zero stay."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny)


def node_area_vectors(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Add up the vectors (s, 3), m^2, of the triangles around each node."""
    sums, areas = np.zeros(positions.shape), area_vectors(positions[triangles])
    for corner in triangles.T:
        for axis in range(3):
            sums[:, axis] += np.bincount(corner, areas[:, axis], len(positions))
    return sums


def node_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Outward unit normals (s, 3) at nodes: means of those of the triangles around, by area."""
    return units(node_area_vectors(positions, triangles))


def volume_within(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Volume that closed triangles enclose, negative where they face inward."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return float(np.einsum("ij,ij->", np.cross(a, b), c)) / 6.0


def closest_on(vertices: np.ndarray, faces: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that finds the points of triangles closest to points (p, 3)."""
    search = _native.SurfaceSearch(np.ascontiguousarray(vertices, dtype=np.float64), faces.astype(np.uint32))
    return lambda points: search.closest(np.ascontiguousarray(points)).reshape(-1, 3)
