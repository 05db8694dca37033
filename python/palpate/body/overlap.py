"""Parts of a mesh that are not connected must not overlap: a tool would touch the one and pass through the other."""

from __future__ import annotations

import itertools

import numpy as np
import scipy

from palpate.errors import BodyError
from palpate.mesh import TetMesh
from palpate.vectors import place_text

# A point is inside of a tetrahedron from this part of its height over each face on: parts that only touch share a face.
DEPTH = 1e-3
# Points that are looked at together, for the memory of their candidates.
BLOCK = 4096


def require_apart(mesh: TetMesh, labels: np.ndarray) -> None:
    """Refuse parts, given by the label (n,) of each node, if one reaches into another.

    Looked at are the nodes and the middles of the elements of each part. Raises BodyError for two parts that overlap,
    with a place at which they do.
    """
    corners = mesh.tets[:, :4]
    of_element = labels[corners[:, 0]]
    parts = [mesh.nodes[corners[of_element == part]] for part in np.unique(of_element)]
    for one, other in itertools.permutations(parts, 2):
        low, high = other.min(axis=(0, 1)), other.max(axis=(0, 1))
        points = np.vstack([np.unique(one.reshape(-1, 3), axis=0), one.mean(axis=1)])
        points = points[((points > low) & (points < high)).all(axis=1)]
        inside = _first_inside(points, other) if len(points) else None
        if inside is not None:
            raise BodyError(
                f"two parts of the mesh that are not connected overlap at {place_text(inside)}: unite them, or make "
                "them two bodies"
            )


def _first_inside(points: np.ndarray, tets: np.ndarray) -> np.ndarray | None:
    """Return a point (3,) that lies inside of some tetrahedron (m, 4, 3), or None."""
    middles = tets.mean(axis=1)
    reach = np.linalg.norm(tets - middles[:, None], axis=2).max(axis=1)
    to_local = np.linalg.inv(np.swapaxes(tets[:, 1:] - tets[:, :1], 1, 2))
    # Elements of one size at a time: a few large ones would make all of them candidates of every point.
    for size in np.unique(np.ceil(np.log2(reach))):
        chosen = np.flatnonzero(np.ceil(np.log2(reach)) == size)
        tree = scipy.spatial.cKDTree(middles[chosen])
        for block in np.array_split(points, -(-len(points) // BLOCK)):
            near = tree.query_ball_point(block, 2.0**size)
            counts = np.fromiter(map(len, near), dtype=np.int64, count=len(near))
            point = np.repeat(np.arange(len(block)), counts)
            tet = chosen[np.fromiter(itertools.chain.from_iterable(near), dtype=np.int64, count=counts.sum())]
            shares = np.einsum("kij,kj->ki", to_local[tet], block[point] - tets[tet, 0])
            inside = np.minimum(shares.min(axis=1), 1.0 - shares.sum(axis=1)) > DEPTH
            if inside.any():
                return block[point[inside][0]]
    return None
