"""How well tetrahedra fill the surface that they were made from, and where they should be smaller.

A straight edge of length `h` on a surface of curvature `k` leaves it by `k h^2 / 8`: what is cut off falls with the
square of the size, so a size at which so much is left follows from one that has been tried. Curved edges leave it by
the fourth power where they could be bent as far as the surface, and by the square where that would have folded an
element.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from palpate.mesh.fill_job import length_text
from palpate.mesh.tetmesh import TetMesh
from palpate.mesh.triangles import closest_on

if TYPE_CHECKING:
    import trimesh

# Loss of volume that is not worth a word; and largest gap, in parts of an element: beyond, a part of the surface is
# missing rather than rounded.
GOOD_LOSS, GOOD_GAP = 0.01, 0.25
SAMPLES = 20_000
# Power of the size by which gaps fall, by the nodes of an element; of curved ones between those of bent and straight.
ORDERS = {4: 2.0, 10: 3.0}
# Below the size that would just do, for sizes are what a mesher aims at.
MARGIN = 0.9


@dataclass(frozen=True, eq=False)
class Fit:
    """A mesh beside the surface it was made from."""

    loss: float  # share of the volume that is missing; negative where there is more
    order: float  # power of the size by which gaps fall
    # (k, 3) places spread evenly over the surface, and their distances (k,) to that of the mesh, m.
    points: np.ndarray
    gaps: np.ndarray

    @classmethod
    def of(cls, mesh: TetMesh, shape: trimesh.Trimesh) -> Fit:
        """Measure a mesh; the same points for every mesh of a shape."""
        import trimesh

        points = np.asarray(trimesh.sample.sample_surface(shape, SAMPLES, seed=0)[0])
        points = np.vstack([shape.vertices, points])
        order = ORDERS[mesh.tets.shape[1]]
        return cls(1.0 - mesh.volume / shape.volume, order, points, distances(mesh, points))

    def is_good(self, size: float) -> bool:
        """Whether volume and surface are kept, by elements of this size."""
        return abs(self.loss) <= GOOD_LOSS and self.gaps.max() <= GOOD_GAP * size

    def sizes(self, now: np.ndarray, least: float) -> np.ndarray:
        """Sizes (k,) at the points that should do, where they are ``now`` (k,) and none shall be below ``least``."""
        if abs(self.loss) <= GOOD_LOSS:
            allowed = 0.5 * GOOD_GAP * now
        else:
            # All gaps smaller in the same proportion as the loss has to be; smaller ones may stay.
            allowed = self.gaps.mean() * GOOD_LOSS / abs(self.loss)
        factor = (allowed / np.maximum(self.gaps, np.finfo(float).tiny)) ** (1.0 / self.order)
        return np.where(factor < 1, np.maximum(MARGIN * factor * now, np.minimum(least, now)), now)

    def size_for_good(self, size: float) -> float:
        """Size of all elements at which the loss should be small."""
        return MARGIN * size * min(1.0, GOOD_LOSS / max(abs(self.loss), GOOD_LOSS)) ** (1.0 / self.order)


def change_text(loss: float, gap: float) -> str:
    """Say how a mesh differs from its surface: by a share of the volume, and by a distance, m, at most."""
    change = f"{'loses' if loss > 0 else 'adds'} {100 * abs(loss):.1f} % of the volume"
    return f"{change} and lies up to {length_text(gap)} off the surface"


def distances(mesh: TetMesh, points: np.ndarray) -> np.ndarray:
    """Distances of points from the surface of a mesh, m."""
    faces = np.searchsorted(mesh.surface_nodes, mesh.surface_triangles)
    return np.linalg.norm(closest_on(mesh.nodes[mesh.surface_nodes], faces)(points) - points, axis=1)


def mean_edge(mesh: TetMesh) -> float:
    """Mean length of the edges of the surface, m."""
    corners = mesh.nodes[mesh.surface_faces[:, :3]]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())
