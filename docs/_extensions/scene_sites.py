"""Sphinx extension: the page of a tutorial's scene, inside the tutorial.

The directive ``scene`` names a file of docs/_scenes without its ending. All scenes share one static site in the folder
``touch`` of the build, with one WebAssembly program.
"""

from __future__ import annotations

import posixpath
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

FOLDER = "touch"
PRECISION = "f16"
STYLE = "width:100%;height:620px;border:1px solid #8888"


class SceneDirective(Directive):
    """Show the page of a scene in a frame, with a link to the page itself."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Make the frame; a scene without a file is an error of the build."""
        env = self.state.document.settings.env
        name = self.arguments[0]
        if name not in scene_files(Path(env.srcdir)):
            raise self.error(f"docs/_scenes has no {name}.toml")
        up = "../" * env.docname.count("/")
        address = posixpath.join(up + FOLDER, f"index.html?scene={name}")
        link = f'<p><a href="{address}">Open it in a window of its own</a>.</p>'
        frame = f'<iframe src="{address}" title="Palpate: {name}" loading="lazy" style="{STYLE}"></iframe>'
        return [nodes.raw("", f"{frame}\n{link}", format="html")]


def scene_files(srcdir: Path) -> dict[str, Path]:
    """Scene files by the name that a tutorial gives."""
    return {path.stem: path for path in sorted((srcdir / "_scenes").glob("*.toml"))}


def write_scenes(app: Sphinx, failed: Exception | None) -> None:
    """Write the site of all scenes beside the pages that show it."""
    files = scene_files(Path(app.srcdir))
    if failed is not None or app.builder.format != "html" or not files:
        return
    from palpate.scene import Scene
    from palpate.viewer.site import with_precision, write_site

    scenes = [(name, with_precision(Scene.read(path), PRECISION)) for name, path in files.items()]
    write_site(scenes, Path(app.outdir) / FOLDER, gallery=False)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive and the step after the build."""
    app.add_directive("scene", SceneDirective)
    app.connect("build-finished", write_scenes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
