"""STL text that programs write and trimesh does not read."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import trimesh

# "solid name" and "end solid name" on lines of their own, where the format has "endsolid name".
_FOOTER = re.compile(rb"^([ \t]*)end[ \t]+solid\b", re.IGNORECASE | re.MULTILINE)


def load_stl(path: Path) -> trimesh.Trimesh:
    """Read an STL file as it is; the footer ``end solid`` of text is taken for ``endsolid``."""
    import trimesh

    content = path.read_bytes()
    # Binary files may begin with "solid" too, but not go on with text.
    if content[:5].lower() == b"solid" and b"facet" in content[:1024]:
        content = _FOOTER.sub(rb"\1endsolid", content)
    return trimesh.load_mesh(io.BytesIO(content), file_type="stl", process=False)
