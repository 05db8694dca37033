"""Sphinx extension: writes the pages of the reference that are generated, before Sphinx reads its sources."""

from __future__ import annotations

from pathlib import Path

import c_pages
import command_pages
import python_pages
import scene_pages
from sphinx.application import Sphinx

PAGES = {
    "commands.md": command_pages.page,
    "scene-keys.md": scene_pages.page,
    "python.md": python_pages.page,
    "c.md": c_pages.page,
}


def write_pages(app: Sphinx) -> None:
    """Write the pages into docs/reference/; unchanged ones keep their time, so that Sphinx need not read them again."""
    folder = Path(app.srcdir) / "reference"
    folder.mkdir(exist_ok=True)
    for name, page in PAGES.items():
        path, text = folder / name, page()
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
