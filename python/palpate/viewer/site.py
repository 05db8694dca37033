"""Static sites: the page, its program and scenes, for any web host."""

from __future__ import annotations

import html
import json
import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from palpate.atomic import folder_beside
from palpate.errors import SceneError, ViewerError
from palpate.green.resources import STORED
from palpate.input_file import require_replaceable
from palpate.scene import BuiltScene, Scene
from palpate.viewer.gallery import PICTURES, Card, gallery_page, gallery_picture
from palpate.viewer.packed_page import packed_page
from palpate.viewer.shown_body import title_of

PROGRAM, PAGE, SCENES = "palpate.wasm", "index.html", "scenes"
# The page of a gallery, whose first page is that of the pictures.
TOUCH_PAGE = "touch.html"


@dataclass(frozen=True)
class SiteSizes:
    """Bytes of a site."""

    program: int  # page and WebAssembly, which all scenes share
    scenes: dict[str, int]  # of each scene by its name
    pictures: int  # of the gallery with its page; 0 of a site with one scene

    @property
    def total(self) -> int:
        """All of it."""
        return self.program + sum(self.scenes.values()) + self.pictures


def write_site(scenes: Sequence[tuple[str, Scene | BuiltScene]], path: Path, gallery: bool | None = None) -> SiteSizes:
    """Write a folder that any web host serves: the page, or with ``gallery`` a page of pictures before it.

    By default several scenes get a gallery. The page opens the first scene, and another one by ``?scene=NAME``. An
    earlier site of that name is replaced, when the new one is complete.

    Raises the errors of :meth:`palpate.Scene.build`, and ViewerError for a place that is no site, scenes of one name,
    or a package without page or program.
    """
    require_replaceable(path, PROGRAM, ViewerError)
    program = find_program()
    names = [plain_name(name) for name, _ in scenes]
    if (twice := next((name for name in names if names.count(name) > 1), None)) is not None:
        raise ViewerError(f"two scenes are called '{twice}': rename one of the files")
    is_gallery, sizes, pictures = len(names) > 1 if gallery is None else gallery, {}, 0
    with folder_beside(path) as folder:
        _copy_page(folder, names, is_gallery)
        shutil.copyfile(program, folder / PROGRAM)
        size_of_program = _size(folder.rglob("*"))
        (folder / SCENES).mkdir()
        cards = []
        for name, (_, scene) in zip(names, scenes, strict=True):
            built = scene if isinstance(scene, BuiltScene) else scene.build()
            data = packed_page(built, name)
            (folder / SCENES / f"{name}.palpate").write_bytes(data)
            sizes[name] = len(data)
            if is_gallery:
                cards.append(_card(folder, name, built, len(data)))
        if is_gallery:
            (folder / PAGE).write_text(gallery_page(cards, TOUCH_PAGE), encoding="utf-8")
            pictures = _size([folder / PAGE, *(folder / PICTURES).iterdir()])
    return SiteSizes(size_of_program, sizes, pictures)


def with_precision(scene: Scene, precision: str) -> Scene:
    """Scene whose stores have numbers of another precision: ``f16`` is half as large to fetch as ``f32``.

    Raises SceneError for a precision that does not exist.
    """
    if precision not in STORED:
        raise SceneError(f"unknown precision '{precision}': use {', '.join(STORED)}")
    bodies = [body.model_copy(update={"precision": precision}) for body in scene.bodies]
    return scene.model_copy(update={"bodies": bodies})


def plain_name(name: str) -> str:
    """Name of a scene in an address."""
    return re.sub(r"[^\w-]+", "-", name) or "scene"


def static_folder() -> Path:
    """Folder of the built page; ViewerError for a package built without the page."""
    static = Path(str(resources.files("palpate.viewer") / "static"))
    if not (static / PAGE).is_file():
        raise ViewerError("the viewer's page is not built: run 'make viewer' (it needs Node)")
    return static


def find_program() -> Path:
    """Path of the WebAssembly; ViewerError for a package built without it."""
    program = Path(str(resources.files("palpate.viewer") / "web" / PROGRAM))
    if not program.is_file():
        raise ViewerError(
            "the program of pages without a server is not built: run 'make web' (needs a WebAssembly target)"
        )
    return program


def meta(name: str, content: str) -> str:
    """Element of a page's head that its script reads."""
    return f'<meta name="palpate-{name}" content="{html.escape(content)}" />'


def _copy_page(folder: Path, names: Sequence[str], is_gallery: bool) -> None:
    """Copy the built page, which opens a scene of the folder and offers the others as models."""
    shutil.copytree(static_folder(), folder, dirs_exist_ok=True)
    page = folder / PAGE
    choices = [{"name": name, "title": title_of(name)} for name in names] if len(names) > 1 else []
    head = f"  {meta('scene', names[0])}\n    {meta('scenes', json.dumps(choices))}\n  </head>"
    text = page.read_text(encoding="utf-8").replace("</head>", head, 1)
    page.unlink()
    (folder / (TOUCH_PAGE if is_gallery else PAGE)).write_text(text, encoding="utf-8")


def _card(folder: Path, name: str, built: BuiltScene, size: int) -> Card:
    """Write the picture of a scene; what the gallery shows of it."""
    picture = folder / PICTURES / f"{name}.webp"
    picture.parent.mkdir(exist_ok=True)
    picture.write_bytes(gallery_picture(built))
    nodes = sum(len(body.body.mesh.nodes) if body.body else len(body.green.surface_nodes) for body in built.bodies)
    moves = any(body.motion is not None for body in built.bodies)
    return Card(name, title_of(name), nodes, moves, size)


def _size(files: Iterable[Path]) -> int:
    return sum(file.stat().st_size for file in files if file.is_file())
