"""The command that writes pages without a server."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.app import app


@app.command()
def web(
    scenes: Annotated[
        list[str],
        typer.Argument(help="Scene files (.toml), stores, or built-in models.", metavar="SCENE..."),
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
    from palpate.cli.checks import scene_of_name
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
