"""Inner boundaries: surfaces within a body that elements follow, so that each element lies on one side of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.errors import MeshError
from palpate.mesh.curve import snap
from palpate.mesh.elements import FACES
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.triangles import closest_on

# Nodes are put on an inner boundary from at most this part of the size of the elements there.
REACH = 0.4
# Points in a tetrahedron, in barycentric coordinates, by which it is counted as within: its middle, and four points
# half way from there to the corners, inside of it, so that neighbours share none.
POINTS = np.vstack([np.full((1, 4), 0.25), 0.125 + 0.5 * np.eye(4)])


@dataclass(frozen=True, eq=False)
class InnerRegion:
    """A part of the body with a boundary of its own."""

    name: str  # of the region in the mesh
    # Triangles of its boundary, (n, 3) m and (k, 3).
    vertices: np.ndarray
    faces: np.ndarray
    inside: Callable[[np.ndarray], np.ndarray]  # whether points (k, 3), m, lie within
    size: float  # size of the elements there, m


@dataclass(frozen=True, eq=False)
class InnerRegions:
    """Regions within a body; where two overlap, the later one counts. ``rest`` names what they leave."""

    rest: str
    regions: Sequence[InnerRegion]

    def names(self) -> Mapping[str, int]:
        """Return the number of each region; 0 for the rest."""
        return {self.rest: 0, **{region.name: rank for rank, region in enumerate(self.regions, 1)}}

    def job(self, origin: np.ndarray, extent: float) -> dict[str, np.ndarray]:
        """Arrays for the mesher's process, lengths in parts of ``extent``."""
        arrays: dict[str, np.ndarray] = {"inner_sizes": np.array([region.size for region in self.regions]) / extent}
        for rank, region in enumerate(self.regions):
            arrays[f"inner_vertices_{rank}"] = (region.vertices - origin) / extent
            arrays[f"inner_faces_{rank}"] = region.faces
        return arrays

    def marked(self, mesh: TetMesh) -> TetMesh:
        """Give each element the region that most of its points lie in."""
        corners = mesh.nodes[mesh.tets[:, :4]]
        points = np.einsum("pk,ekj->epj", POINTS, corners).reshape(-1, 3)
        of_point = np.zeros(len(points), dtype=np.int64)
        for rank, region in enumerate(self.regions, 1):
            of_point[region.inside(points)] = rank
        counts = np.stack([(of_point == k).reshape(-1, len(POINTS)).sum(axis=1) for k in range(len(self.regions) + 1)])
        return TetMesh(mesh.nodes, mesh.tets, counts.argmax(axis=0), self.names())

    def require_elements(self, name: str, mesh: TetMesh) -> None:
        """Raise MeshError with the first region that has no element in a mesh."""
        there = set(np.unique(mesh.regions).tolist())
        for title, number in self.names().items():
            if number not in there:
                raise MeshError(f"{name}: segment '{title}' is too small for the elements; --max-size makes finer ones")

    def snapped(self, mesh: TetMesh) -> TetMesh:
        """Put inner nodes between regions onto the boundaries, as far as no element becomes bad."""
        return snap(mesh, self.project, np.setdiff1d(faces_between(mesh), mesh.surface_nodes))

    def project(self, points: np.ndarray) -> np.ndarray:
        """Closest points on the boundary that is nearest; a point that is far from all stays."""
        best, result = np.full(len(points), np.inf), points.copy()
        for region in self.regions if len(points) else ():
            closest = closest_on(region.vertices, region.faces)(points)
            away = np.linalg.norm(closest - points, axis=1)
            nearer = away < np.minimum(best, REACH * region.size)
            best[nearer], result[nearer] = away[nearer], closest[nearer]
        return result


def faces_between(mesh: TetMesh) -> np.ndarray:
    """Corners (k, 3) of the faces between elements of different regions."""
    corners = np.sort(mesh.tets[:, :4][:, FACES[4]].reshape(-1, 3), axis=1)
    order = np.lexsort(corners.T)
    regions = np.repeat(mesh.regions, 4)[order]
    corners = corners[order]
    same = (corners[1:] == corners[:-1]).all(axis=1) & (regions[1:] != regions[:-1])
    return corners[1:][same]
