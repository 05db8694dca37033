"""Surface files that trimesh does not read: STL with other footers or bytes behind it, PLY of strips and lists."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import trimesh

# "solid name" and "end solid name" on lines of their own, where the format has "endsolid name".
_FOOTER = re.compile(rb"^([ \t]*)end[ \t]+solid\b", re.IGNORECASE | re.MULTILINE)
_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE | re.MULTILINE)
# Of a binary file: header, count, and a record for each triangle of a normal, three corners and two bytes.
HEADER, RECORD = 84, 50
TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
# Ends a strip in a list of strips.
RESTART = -1


def load_stl(path: Path) -> trimesh.Trimesh:
    """Read an STL file as it is; the footer ``end solid`` of text is taken for ``endsolid``."""
    import trimesh

    content = path.read_bytes()
    # Binary files may begin with "solid" too, but not go on with text.
    if content[:5].lower() == b"solid" and b"facet" in content[:1024]:
        content = _FOOTER.sub(rb"\1endsolid", content)
    return trimesh.load_mesh(io.BytesIO(content), file_type="stl", process=False)


def read_stl(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Read vertices (3 k, 3) and triangles (k, 3) of text between comments, or of a binary with bytes behind it.

    Raises ValueError for a number that cannot be read, or corners that are no whole triangles.
    """
    content = path.read_bytes()
    count = int(np.frombuffer(content, "<u4", 1, HEADER - 4)[0]) if len(content) > HEADER else 0
    if 0 < count <= (len(content) - HEADER) // RECORD:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(content, kind, count, HEADER)["corners"].reshape(-1, 3).astype(np.float64)
    else:
        corners = np.array([[float(x) for x in found] for found in _VERTEX.findall(content)]).reshape(-1, 3)
    if len(corners) == 0 and count > 0:
        there = (len(content) - HEADER) // RECORD
        raise ValueError(f"it is cut short: its header counts {count} triangles, {there} are there")
    if len(corners) == 0 or len(corners) % 3:
        raise ValueError(f"it holds {len(corners)} corners of triangles")
    return corners, np.arange(len(corners)).reshape(-1, 3)


class _Property(NamedTuple):
    name: str
    count: str | None
    kind: str


class _Element(NamedTuple):
    name: str
    count: int
    properties: list[_Property]


def has_strips(path: Path) -> bool:
    """Whether a PLY file holds triangle strips, as older scanners write them."""
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
