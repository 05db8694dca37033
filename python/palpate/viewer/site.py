"""Static sites: the page, its program and scenes, for any web host."""

from __future__ import annotations

import html
import re
import shutil
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from palpate.atomic import folder_beside
from palpate.errors import ViewerError
from palpate.scene import BuiltScene, Scene
from palpate.viewer.packed_page import packed_page

PROGRAM, PAGE, SCENES = "palpate.wasm", "index.html", "scenes"


def write_site(scenes: Sequence[tuple[str, Scene | BuiltScene]], path: Path) -> dict[str, int]:
    """Write a folder that any web host serves; the page opens the first scene, and another one by ``?scene=NAME``.

    An earlier site of that name is replaced, when the new one is complete.

    Returns
    -------
    dict
        Bytes of the program (page and WebAssembly), and of each scene by its name.

    Raises
    ------
    ViewerError
        A place that is no site, or a package without page or program.
    Error
        As of :meth:`palpate.Scene.build`.

    """
    _require_replaceable(path)
    program = _program()
    names = [plain_name(name) for name, _ in scenes]
    sizes: dict[str, int] = {}
    with folder_beside(path) as folder:
        _copy_page(folder, names[0])
        shutil.copyfile(program, folder / PROGRAM)
        sizes["program"] = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
        (folder / SCENES).mkdir()
        for name, (_, scene) in zip(names, scenes, strict=True):
            built = scene if isinstance(scene, BuiltScene) else scene.build()
            data = packed_page(built)
            (folder / SCENES / f"{name}.palpate").write_bytes(data)
            sizes[name] = len(data)
    return sizes


def with_precision(scene: Scene, precision: str) -> Scene:
    """Scene whose stores have numbers of another precision: ``f16`` is half as large to fetch as ``f32``."""
    bodies = [body.model_copy(update={"precision": precision}) for body in scene.bodies]
    return scene.model_copy(update={"bodies": bodies})


def plain_name(name: str) -> str:
    """Name of a scene in an address."""
    return re.sub(r"[^\w-]+", "-", name) or "scene"


def _require_replaceable(path: Path) -> None:
    if path.is_dir() and any(path.iterdir()) and not (path / PROGRAM).is_file():
        raise ViewerError(f"{path}: is a folder of something else: give another name")
    if path.exists() and not path.is_dir():
        raise ViewerError(f"{path}: is a file: give another name, or delete it first")


def _program() -> Path:
    program = Path(str(resources.files("palpate.viewer") / "web" / PROGRAM))
    if not program.is_file():
        raise ViewerError(
            "the program of pages without a server is not built: run 'make web' (needs a WebAssembly target)"
        )
    return program


def _copy_page(folder: Path, name: str) -> None:
    """Copy the built page, which opens a scene of the folder."""
    static = Path(str(resources.files("palpate.viewer") / "static"))
    if not (static / PAGE).is_file():
        raise ViewerError("the viewer's page is not built: run 'make viewer' (it needs Node)")
    shutil.copytree(static, folder, dirs_exist_ok=True)
    text = (folder / PAGE).read_text()
    meta = f'<meta name="palpate-scene" content="{html.escape(name)}" />'
    (folder / PAGE).write_text(text.replace("</head>", f"  {meta}\n  </head>", 1))
