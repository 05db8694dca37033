"""PLY files that trimesh does not read: triangle strips, as older scanners write them, and lists of any order."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
# Ends a strip in a list of strips.
RESTART = -1


class _Property(NamedTuple):
    name: str
    count: str | None
    kind: str


class _Element(NamedTuple):
    name: str
    count: int
    properties: list[_Property]


def has_strips(path: Path) -> bool:
    """Whether a PLY file holds triangle strips."""
    with path.open("rb") as file:
        head = file.read(4096)
    return head.startswith(b"ply") and b"element tristrips" in head.split(b"end_header")[0]


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Read vertices (n, 3) and triangles (k, 3); polygons are cut into fans, strips into triangles.

    Raises ValueError for a header that cannot be read, a file that is cut short, or one without triangles.
    """
    head, order, body = _header(path.read_bytes())
    source = _Text(body) if order is None else _Binary(body, order)
    vertices, faces = np.empty((0, 3)), []
    for element in head:
        names = [p.name for p in element.properties]
        lists = [p.count is not None for p in element.properties]
        if not any(lists):
            rows = source.rows(element)
            if element.name == "vertex":
                vertices = np.column_stack([rows[names.index(axis)] for axis in "xyz"]).astype(np.float64)
            continue
        for _ in range(element.count):
            row = [source.values(p) for p in element.properties]
            if element.name in ("face", "tristrips"):
                indices = row[lists.index(True)].astype(np.int64)
                faces.append(_fan(indices) if element.name == "face" else _strips(indices))
    triangles = np.concatenate(faces) if faces else np.empty((0, 3), dtype=np.int64)
    if len(triangles) == 0:
        raise ValueError("it holds no triangles")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise ValueError("a triangle names a vertex that does not exist")
    return vertices, triangles


def _header(content: bytes) -> tuple[list[_Element], str | None, bytes]:
    mark = content.find(b"end_header")
    if not content.startswith(b"ply") or mark < 0:
        raise ValueError("its header has no end")
    begin = content.find(b"\n", mark)
    elements: list[_Element] = []
    order: str | None = None
    for line in content[:mark].decode("ascii", "replace").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:2] == ["property", "list"]:
            elements[-1].properties.append(_Property(words[4], TYPES[words[2]], TYPES[words[3]]))
        elif words[:1] == ["property"]:
            elements[-1].properties.append(_Property(words[2], None, TYPES[words[1]]))
    return elements, order, content[begin + 1 :]


class _Binary:
    """Values of a binary file, one after the other."""

    def __init__(self, body: bytes, order: str):
        self._body, self._order, self._at = body, order, 0

    def rows(self, element: _Element) -> list[np.ndarray]:
        kind = np.dtype([(f"p{i}", self._order + p.kind) for i, p in enumerate(element.properties)])
        table = self._take(kind, element.count)
        return [table[f"p{i}"] for i in range(len(element.properties))]

    def values(self, wanted: _Property) -> np.ndarray:
        count = 1 if wanted.count is None else int(self._take(np.dtype(self._order + wanted.count), 1)[0])
        return self._take(np.dtype(self._order + wanted.kind), count)

    def _take(self, kind: np.dtype, count: int) -> np.ndarray:
        begin, self._at = self._at, self._at + kind.itemsize * count
        if count < 0 or self._at > len(self._body):
            raise ValueError("it is cut short")
        return np.frombuffer(self._body, kind, count, begin)


class _Text:
    """Values of a text file, one after the other."""

    def __init__(self, body: bytes):
        self._numbers, self._at = np.array(body.split(), dtype=np.float64), 0

    def rows(self, element: _Element) -> list[np.ndarray]:
        width = len(element.properties)
        return list(self._take(width * element.count).reshape(element.count, width).T)

    def values(self, wanted: _Property) -> np.ndarray:
        return self._take(1 if wanted.count is None else int(self._take(1)[0]))

    def _take(self, count: int) -> np.ndarray:
        begin, self._at = self._at, self._at + count
        if count < 0 or self._at > len(self._numbers):
            raise ValueError("it is cut short")
        return self._numbers[begin : self._at]


def _fan(polygon: np.ndarray) -> np.ndarray:
    return np.column_stack(
        [np.full(max(len(polygon) - 2, 0), polygon[0] if len(polygon) else 0), polygon[1:-1], polygon[2:]]
    )


def _strips(indices: np.ndarray) -> np.ndarray:
    """Triangles of strips: each index after the second makes one with the two before, every other one turned round."""
    ends = np.flatnonzero(indices == RESTART)
    polygons = []
    for piece in np.split(indices, ends):
        strip = piece[piece != RESTART]
        if len(strip) < 3:
            continue
        triangles = np.column_stack([strip[:-2], strip[1:-1], strip[2:]])
        triangles[1::2] = triangles[1::2][:, [1, 0, 2]]
        polygons.append(triangles)
    found = np.concatenate(polygons) if polygons else np.empty((0, 3), dtype=np.int64)
    # Strips turn corners by repeating a vertex.
    return found[(found != np.roll(found, 1, axis=1)).all(axis=1)]
