"""Areas and normals of flat triangles, and normals at the nodes that they join."""

from __future__ import annotations

import numpy as np


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """Vectors (..., 3), m^2, across triangles (..., 3, 3), m, counter-clockwise round them, as long as their areas."""
    a, b, c = np.moveaxis(corners, -2, 0)
    return np.cross(b - a, c - a) / 2


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
