"""Commands that write scenes for elsewhere: a folder for programs without Python, pages without a server."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from palpate import simulation
from palpate.cli.app import app
from palpate.cli.checks import scene_of_file, scene_of_name
from palpate.units import count_text


@app.command()
def pack(
    scene: Annotated[Path, typer.Argument(help="A scene file (.toml), or a precomputed store.")],
    out: Annotated[Path, typer.Argument(help="Folder to write; an earlier packed scene there is replaced.")],
) -> None:
    """Write a scene as a folder that programs in C, C++ or Rust load without Python.

    Example: palpate pack scene.toml liver.pack
    """
    read = scene_of_file(scene)
    simulation.pack(read, out)
    size = sum(file.stat().st_size for file in out.iterdir())
    counts = f"{count_text(len(read.bodies), 'body', 'bodies')}, {count_text(len(read.tools), 'tool')}"
    print(f"{out}: {counts}, {size / 1e6:.1f} MB")


@app.command()
def web(
    scenes: Annotated[
        list[str], typer.Argument(help="Scene files (.toml), stores, or built-in models.", metavar="SCENE...")
    ],
    out: Annotated[Path, typer.Argument(help="Folder to write; an earlier site there is replaced.")],
    precision: Annotated[
        str | None,
        typer.Option(help="Numbers in the stores: f16 is half as large to fetch as f32; default: the scene's."),
    ] = None,
) -> None:
    """Write scenes as a static site: page and WebAssembly, for any web host.

    Several scenes get a first page with a picture of each.

    Example: palpate web liver scene.toml site, then python -m http.server -d site
    """
    from palpate.viewer.site import with_precision, write_site

    read = {given: scene_of_name(given) for given in scenes}
    chosen = read if precision is None else {given: with_precision(scene, precision) for given, scene in read.items()}
    built = [(Path(given).stem, scene.build()) for given, scene in chosen.items()]
    sizes = write_site(built, out)
    for (_, scene), (name, size) in zip(built, sizes.scenes.items(), strict=True):
        error = max(body.green._core.typical_errors[0] for body in scene.bodies)
        print(f"{name}: {size / 1e6:.1f} MB, forces right to {100 * error:.2g} %")
    print(f"{out}: program {sizes.program / 1e6:.1f} MB, in all {sizes.total / 1e6:.1f} MB")
    print(f"python -m http.server -d {shlex.quote(str(out))}")
