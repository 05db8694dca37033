"""The surface that a page draws of a body: all of it, or fewer triangles where there are more than a page takes.

Vertices that are drawn are surface nodes, in place: displacements and fields are exact there, and what is left out is
only the nodes between. What is felt knows nothing of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate import _native
from palpate.mesh.elements import face_owners
from palpate.mesh.triangles import node_normals
from palpate.scene import BuiltBody

# Triangles of one body that a page draws at most: docs/benchmarks.md.
MOST_TRIANGLES = 60_000
# Sheets that face away from each other are apart: a normal counts as so many mean distances between drawn vertices.
APART = 4.0


@dataclass(frozen=True)
class DrawnSurface:
    """What is drawn of a surface of s nodes."""

    nodes: np.ndarray  # rows (v,) of the surface nodes that are drawn, ascending
    triangles: np.ndarray  # corners (k, 3) among them
    regions: np.ndarray  # rank of the region behind each triangle (k,)
    # The drawn vertex that stands for each surface node (s,); None where all are drawn.
    owners: np.ndarray | None = None
    deviation: float = 0.0  # how far the surface lies from the drawn triangles at rest, about, m

    @property
    def is_whole(self) -> bool:
        """Whether all of the surface is drawn."""
        return self.owners is None


def drawn_surface(built: BuiltBody, of_element: np.ndarray, most: int | None = None) -> DrawnSurface:
    """Surface of a body, or at most about so many triangles of it, by default as many as a page takes.

    ``of_element`` has the region of each element.
    """
    green = built.green
    triangles = np.searchsorted(green.surface_nodes, green.surface_triangles)
    regions = _regions(built, of_element, len(triangles))
    return drawn_triangles(green.surface_positions, triangles, regions, most)


def drawn_triangles(
    positions: np.ndarray, triangles: np.ndarray, regions: np.ndarray, most: int | None = None
) -> DrawnSurface:
    """Do the same for triangles (k, 3) of positions (s, 3), m, with the region behind each (k,)."""
    most = MOST_TRIANGLES if most is None else most
    if len(triangles) <= most:
        return DrawnSurface(np.arange(len(positions)), triangles, regions)
    parts, deviation = [], 0.0
    seams = _on_seams(triangles, regions, len(positions))
    for region in np.unique(regions):
        corners = triangles[regions == region].astype(np.uint32)
        fewer, off = _native.simplified(positions, corners.ravel(), seams, int(most * len(corners) / len(triangles)))
        parts.append((fewer.reshape(-1, 3), np.full(len(fewer) // 3, region)))
        deviation = max(deviation, off)
    corners = np.vstack([corners for corners, _ in parts])
    nodes, ranks = np.unique(corners, return_inverse=True)
    owners = _owners(positions, node_normals(positions, triangles), nodes)
    return DrawnSurface(nodes, ranks.reshape(-1, 3), np.concatenate([r for _, r in parts]), owners, deviation)


def _regions(built: BuiltBody, of_element: np.ndarray, count: int) -> np.ndarray:
    """Rank of the region behind each triangle of the surface (k,)."""
    if built.body is None or not of_element.any():
        return np.zeros(count, dtype=np.int64)
    owners = face_owners(built.body.mesh.tets)
    # A face with mid-side nodes is drawn as several triangles.
    return of_element[np.repeat(owners, count // len(owners))]


def _on_seams(triangles: np.ndarray, regions: np.ndarray, count: int) -> np.ndarray:
    """Whether each node (s,) is a corner of triangles of several regions."""
    low, high = np.full(count, regions.max() + 1), np.full(count, -1)
    for corner in triangles.T:
        np.minimum.at(low, corner, regions)
        np.maximum.at(high, corner, regions)
    return low < high


def _owners(positions: np.ndarray, normals: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Drawn vertex (s,) that is nearest to each node on its own side of the body."""
    from scipy.spatial import cKDTree

    tree = cKDTree(positions[nodes])
    spacing = float(np.median(tree.query(positions[nodes], k=2)[0][:, 1]))
    sided = np.hstack([positions, APART * spacing * normals])
    return cKDTree(sided[nodes]).query(sided)[1]
