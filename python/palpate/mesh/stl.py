"""STL text and binaries that programs write and trimesh does not read."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import trimesh

# "solid name" and "end solid name" on lines of their own, where the format has "endsolid name".
_FOOTER = re.compile(rb"^([ \t]*)end[ \t]+solid\b", re.IGNORECASE | re.MULTILINE)
_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE | re.MULTILINE)
# Of a binary file: header, count, and a record for each triangle of a normal, three corners and two bytes.
HEADER, RECORD = 84, 50


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
