"""A scene in a notebook: the page of `palpate web` as a widget, on the same program."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.errors import Error

if TYPE_CHECKING:
    from palpate.scene import BuiltScene, Scene

# What the script of the widget puts addresses in place of.
_SCRIPT, _FILES = "__palpate_script__", "__palpate_files__"


def widget(scene: Scene | BuiltScene | str | Path, height: int = 520) -> Any:
    """Show a scene in a Jupyter notebook, to be touched there.

    The loop runs in the browser, as in a page of ``palpate web``: a notebook on another machine needs no further port.

    Parameters
    ----------
    scene
        A scene, or the path of a scene file. Bodies are meshed and precomputed if need be.
    height
        Of the widget, pixels of the page.

    Returns
    -------
    anywidget.AnyWidget
        Shown as the last line of a cell; its ``height`` can be changed.

    Raises
    ------
    Error
        anywidget is not installed (``pip install 'palpate[notebook]'``), or as of :meth:`palpate.Scene.build`.

    Examples
    --------
    >>> palpate.widget("examples/block.toml")  # doctest: +SKIP

    """
    from palpate.scene import BuiltScene, Scene
    from palpate.viewer.packed_page import packed_page
    from palpate.viewer.site import find_program

    kind = _widget_kind()
    given = Scene.read(scene) if isinstance(scene, (str, Path)) else scene
    built = given if isinstance(given, BuiltScene) else given.build()
    name = built.scene.name
    page, script, worker = _page(name)
    return kind(
        page=page,
        script=script,
        worker=worker,
        program=find_program().read_bytes(),
        scene=packed_page(built, name),
        height=height,
    )


@cache
def _widget_kind() -> type:
    try:
        import anywidget
        import traitlets
    except ImportError:
        raise Error("a widget needs anywidget: pip install 'palpate[notebook]'") from None

    class PalpateWidget(anywidget.AnyWidget):
        """A page without a server."""

        _esm = Path(__file__).with_suffix(".mjs").read_text(encoding="utf-8")
        page = traitlets.Unicode().tag(sync=True)
        script = traitlets.Unicode().tag(sync=True)
        worker = traitlets.Unicode().tag(sync=True)
        program = traitlets.Bytes().tag(sync=True)
        scene = traitlets.Bytes().tag(sync=True)
        height = traitlets.Int().tag(sync=True)

    return PalpateWidget


def _page(name: str) -> tuple[str, str, str]:
    """Return the page with its style inside and the places of its addresses, its script, and the worker's."""
    from palpate.viewer.site import PAGE, meta, static_folder

    static = static_folder()
    text = (static / PAGE).read_text(encoding="utf-8")
    sources = re.findall(r'<script[^>]* src="\./([^"]+)"', text)
    styles = re.findall(r'<link rel="stylesheet"[^>]* href="\./([^"]+)"', text)
    workers = [path for path in (static / "assets").glob("*.js") if f"assets/{path.name}" not in sources]
    if len(sources) != 1 or len(workers) != 1:
        raise Error("the built page is not as the widget expects: run 'make viewer' again")
    style = "".join((static / path).read_text(encoding="utf-8") for path in styles)
    head = f"  <style>{style}</style>\n    {meta('scene', name)}\n    {meta('files', _FILES)}\n  </head>"
    text = re.sub(r'\s*<link rel="(?:stylesheet|icon)"[^>]*>', "", text)
    text = text.replace(f"./{sources[0]}", _SCRIPT).replace("</head>", head, 1)
    return text, (static / sources[0]).read_text(encoding="utf-8"), workers[0].read_text(encoding="utf-8")
