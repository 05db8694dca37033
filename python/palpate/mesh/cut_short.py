"""Text files of surfaces that end before what they announce: an interrupted copy, a full disk."""

from __future__ import annotations

import re
from pathlib import Path

from palpate.errors import MeshError

# What every writer ends an STL text with; some write "end solid".
_END_OF_STL = re.compile(rb"\bend[ \t]*solid\b", re.IGNORECASE)
# A header of PLY, or the first line of OFF that is no comment, is shorter than this.
HEAD, TAIL = 4096, 4096


def require_whole(path: Path, triangles: int) -> None:
    """Raise MeshError for a file with fewer faces than its header counts, or an STL text without its end.

    Polygons are cut into triangles, so that a whole file has at least as many ``triangles``, which were read, as faces.
    Binary files are refused by their readers.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
        file.seek(-min(TAIL, path.stat().st_size), 2)
        tail = file.read()
    faces = _declared_faces(path.suffix.lower(), head)
    if triangles < faces:
        raise MeshError(f"{path}: it is cut short: its header counts {faces} faces, {triangles} are there")
    is_text = head[:5].lower() == b"solid" and b"\0" not in head
    if path.suffix.lower() == ".stl" and is_text and not _END_OF_STL.search(tail):
        raise MeshError(
            f"{path}: it is cut short: 'endsolid' is missing after {triangles} triangles; copy it again, or add that "
            "line if it is whole"
        )


def _declared_faces(ending: str, head: bytes) -> int:
    """Return how many faces a header of PLY or OFF counts, 0 where there is none."""
    if ending == ".ply":
        found = re.search(rb"^element[ \t]+face[ \t]+(\d+)", head, re.MULTILINE)
        return int(found.group(1)) if found else 0
    if ending == ".off":
        words = re.sub(rb"#[^\n]*", b"", head).split()
        return int(words[2]) if len(words) > 2 and words[0].upper().endswith(b"OFF") and words[2].isdigit() else 0
    return 0
