"""Gmsh's first format (`$NOD`, `$ELM`), which older programs still write and meshio does not read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.errors import MeshError

if TYPE_CHECKING:
    import meshio

# Solid elements by Gmsh's number of their type: meshio's name, and its order of the nodes.
SOLIDS = {
    4: ("tetra", [0, 1, 2, 3]),
    5: ("hexahedron", list(range(8))),
    6: ("wedge", list(range(6))),
    7: ("pyramid", list(range(5))),
    11: ("tetra10", [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
}
# Points, lines and faces, which a solid does not need.
LOWER = {1, 2, 3, 8, 9, 10, 15, 16}


def is_first_format(path: Path) -> bool:
    """Whether a file begins as one of the first format does."""
    with path.open("rb") as file:
        return file.read(256).lstrip().startswith(b"$NOD")


def read_first_format(path: Path) -> meshio.Mesh:
    """Read nodes and solid elements; the physical number of an element is its region.

    Raises MeshError for a file that is cut short or has elements of another kind, with the line.
    """
    import meshio

    lines = enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
    try:
        nodes = [(int(words[0]), [float(x) for x in words[1:4]]) for words in _section(lines, "$NOD")]
        rank = {number: row for row, (number, _) in enumerate(nodes)}
        cells: dict[str, list[list[int]]] = {}
        regions: dict[str, list[int]] = {}
        for words in _section(lines, "$ELM"):
            kind, region, of_element = int(words[1]), int(words[2]), [rank[int(word)] for word in words[5:]]
            if kind in LOWER:
                continue
            if kind not in SOLIDS:
                raise MeshError(f"{path}: elements of Gmsh's type {kind} are not read: save 4- or 10-node tetrahedra")
            name, order = SOLIDS[kind]
            cells.setdefault(name, []).append([of_element[node] for node in order])
            regions.setdefault(name, []).append(region)
    except (ValueError, KeyError, IndexError):
        number = next(lines, (None, ""))[0]
        where = f":{number - 1}" if number else ""
        raise MeshError(f"{path}{where}: is no whole file of Gmsh's first format") from None
    points = np.array([place for _, place in nodes], dtype=float).reshape(-1, 3)
    blocks = [(name, np.array(rows)) for name, rows in cells.items()]
    return meshio.Mesh(points, blocks, cell_data={"gmsh:physical": [np.array(regions[name]) for name in cells]})


def _section(lines: Iterator[tuple[int, str]], name: str) -> Iterator[list[str]]:
    """Words of the lines of a section, of which there must be as many as it says."""
    for _, line in lines:
        if line.strip() == name:
            break
    count = int(next(lines, (0, ""))[1])
    for _ in range(count):
        yield next(lines, (0, ""))[1].split()
