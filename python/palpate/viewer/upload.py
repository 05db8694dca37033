"""A file that a page sends: its name and size first, then its bytes in parts."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from palpate.errors import ViewerError
from palpate.mesh.files import WRITERS
from palpate.mesh.surface_file import SURFACE_ENDINGS
from palpate.segmentation.endings import SEGMENTATION_ENDINGS
from palpate.viewer.messages import whole

# Endings of the files that a page may send: surfaces, segmentations, and volume meshes that are one file.
ENDINGS = (*SURFACE_ENDINGS, *SEGMENTATION_ENDINGS, *(ending for ending in WRITERS if ending not in {".node", ".ele"}))
# A binary STL of four million triangles has 200 MB.
MAX_FILE = 200_000_000
# Bytes of a part: one message, which the server answers before the next comes.
MAX_PART = 262_144
# Bytes of a name; file systems take 255.
LONGEST_NAME = 120


class Upload:
    """A file on its way into a folder; ViewerError if it is announced as too large, or of an unknown kind."""

    def __init__(self, message: Mapping[str, Any], folder: Path):
        self.file = safe_name(message.get("name"))
        if not self.file.lower().endswith(ENDINGS):
            raise ViewerError(_wrong_kind(self.file))
        if isinstance(message.get("size"), int) and message["size"] > MAX_FILE:
            size, most = min(message["size"], 10**15) // 10**6, MAX_FILE // 10**6
            raise ViewerError(f"{self.file} has {size} MB: the page takes files up to {most} MB")
        self.size = whole(message, "size", 1, MAX_FILE)
        self.folder, self.received = folder, 0
        self._output = (folder / self.file).open("wb")

    @property
    def is_complete(self) -> bool:
        """Whether all bytes have come."""
        return self.received == self.size

    def take(self, part: bytes) -> None:
        """Take the next part; ViewerError for more than was announced, or a disk that is full."""
        if self.received + len(part) > self.size or not part:
            self.close()
            raise ViewerError(f"{self.file}: its parts do not come to {self.size} bytes")
        try:
            self._output.write(part)
            self.received += len(part)
            if self.is_complete:
                self._output.close()
        except OSError as error:
            self.close()
            raise ViewerError(f"{self.file}: cannot be kept: {error.strerror or error}") from None

    def close(self) -> None:
        """Give up what has come."""
        self._output.close()


def safe_name(name: Any) -> str:
    """Name of a file without a folder, and without characters that a file system or a terminal may not take.

    Raises ViewerError for what is no name.
    """
    if not isinstance(name, str) or len(name.encode("utf-8", "replace")) > LONGEST_NAME:
        raise ViewerError(f"upload: name must be a text of at most {LONGEST_NAME} bytes")
    safe = re.sub(r"[^\w. -]", "_", name).strip(". ")
    if not Path(safe).stem.strip(". _"):
        raise ViewerError("upload: the file needs a name")
    return safe


def _wrong_kind(file: str) -> str:
    ending = Path(file).suffix.lower()
    if ending in {".toml", ".palpate"}:
        return f"{file}: scenes and stores are opened where they lie: palpate run {shlex.quote(str(file))}"
    return f"{file}: no surface, mesh or segmentation by its ending; the page takes {', '.join(ENDINGS)}"
