"""Cells of volume meshes that are not tetrahedra: hexahedra, wedges and pyramids split into them, all others refused.

A cell is split from its node of lowest index: that node is joined to the triangles of the faces that do not contain
it, and a quadrilateral is cut by the diagonal from its own lowest node. Neighbours so agree on the diagonal of the face
they share, whatever their shapes (J. Dompierre, P. Labbe, M.-G. Vallet and R. Camarero, How to subdivide pyramids,
prisms, and hexahedra into tetrahedra, 8th International Meshing Roundtable, 1999). No node is added.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.errors import MeshError
from palpate.mesh.elements import corner_volumes, longest_edges

# Faces by the corners of each shape, all outward or all inward; those with three corners repeat the last.
FACES = {
    "tetra": [[1, 2, 3, 3], [0, 3, 2, 2], [0, 1, 3, 3], [0, 2, 1, 1]],
    "pyramid": [[0, 3, 2, 1], [0, 1, 4, 4], [1, 2, 4, 4], [2, 3, 4, 4], [3, 0, 4, 4]],
    "wedge": [[0, 2, 1, 1], [3, 4, 5, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    "hexahedron": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
}
CORNERS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
# meshio's names of cells with more nodes than corners, whose corners come first.
CURVED = {
    "tetra10": "tetra",
    "pyramid14": "pyramid",
    "wedge18": "wedge",
    "hexahedron20": "hexahedron",
    "hexahedron27": "hexahedron",
}
# A tetrahedron flatter than this part of the cube of its cell's size is none.
FLAT = 1e-12

Block = tuple[str, np.ndarray, int]
"""Type of a run of cells in meshio's words, their nodes, and the index of the first in its file."""


def shape_of(kind: str) -> str | None:
    """Shape of a cell by its corners; None for a type that is not read."""
    return CURVED.get(kind, kind if kind in CORNERS else None)


def split(nodes: np.ndarray, blocks: Sequence[Block]) -> tuple[np.ndarray, np.ndarray]:
    """Split cells at their corners.

    Parameters
    ----------
    nodes
        (n, 3) positions, of any unit.
    blocks
        The cells.

    Returns
    -------
    tuple
        Tetrahedra (m, 4), in the cells' order, and for each its cell (m,), counted through the blocks.

    Raises
    ------
    MeshError
        A cell so bent that the tetrahedra overlap, or tetrahedra on the two sides of a face whose diagonals cross.

    """
    tets, cells, quads, first = [], [], [], 0
    for kind, connectivity, index in blocks:
        shape = CURVED.get(kind, kind)
        corners = connectivity[:, : CORNERS[shape]].astype(np.int64)
        of_block, of_cell = _joined(corners, np.array(FACES[shape]))
        _check_straight(nodes, of_block, of_cell, kind, index, len(corners))
        faces = corners[:, FACES[shape]].reshape(-1, 4)
        quads.append(faces[(np.diff(np.sort(faces, axis=1), axis=1) != 0).all(axis=1)])
        tets.append(of_block)
        cells.append(first + of_cell)
        first += len(corners)
    all_tets = np.concatenate(tets)
    _check_diagonals(all_tets, np.concatenate(quads))
    return all_tets, np.concatenate(cells)


def _joined(corners: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra from the lowest node of each cell to the triangles of the other faces, and the cell of each."""
    quads = corners[:, faces]
    # The lowest node of a face first: the diagonal starts there.
    turn = (np.argmin(quads, axis=2)[:, :, None] + np.arange(4)) % 4
    quads = np.take_along_axis(quads, turn, axis=2)
    triangles = np.stack([quads[..., [0, 1, 2]], quads[..., [0, 2, 3]]], axis=2).reshape(len(corners), -1, 3)
    apex = corners.min(axis=1)
    a, b, c = (triangles[..., k] for k in range(3))
    # Cells with corners that coincide (a wedge written as a hexahedron) have triangles without area.
    whole = (a != b) & (b != c) & (a != c) & (triangles != apex[:, None, None]).all(axis=2)
    cell, place = np.nonzero(whole)
    return np.column_stack([apex[cell], triangles[cell, place]]), cell


def _check_straight(nodes: np.ndarray, tets: np.ndarray, cell: np.ndarray, kind: str, first: int, count: int) -> None:
    """Refuse cells that their tetrahedra do not fill once."""
    volumes = corner_volumes(nodes, tets)
    sides = np.where(np.abs(volumes) <= FLAT * longest_edges(nodes, tets) ** 3, 0, np.sign(volumes))
    low, high = np.full(count, 2.0), np.full(count, -2.0)
    np.minimum.at(low, cell, sides)
    np.maximum.at(high, cell, sides)
    bad = np.flatnonzero((low != high) | (low == 0))
    if bad.size:
        raise MeshError(
            f"{bad.size} cells of type {kind} are too bent to be split into tetrahedra (first: cell {first + bad[0]})"
        )


def _check_diagonals(tets: np.ndarray, quads: np.ndarray) -> None:
    """Refuse tetrahedra that meet a quadrilateral across its other diagonal: the body would be cracked there."""
    faces = np.sort(tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    triangles, counts = np.unique(faces, axis=0, return_counts=True)
    lowest = np.argmin(quads, axis=1)
    turned = np.take_along_axis(quads, (lowest[:, None] + np.arange(4)) % 4, axis=1)
    other = np.sort(turned[:, [[0, 1, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    either, count = np.unique(
        np.concatenate([triangles[counts == 1], np.unique(other, axis=0)]), axis=0, return_counts=True
    )
    if (count > 1).any():
        raise MeshError(
            f"tetrahedra meet the quadrilateral faces of other cells without pyramids between (first: at nodes "
            f"{either[count > 1][0].tolist()}), so that no splitting fits; mesh the body with one kind of cell"
        )
