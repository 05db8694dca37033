"""The command that writes a page without a server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.app import app


@app.command()
def web(
    scene: Annotated[Path, typer.Argument(help="A scene file (.toml), or a precomputed store.")],
    out: Annotated[Path, typer.Argument(help="Folder to write; an earlier site there is replaced.")],
    precision: Annotated[
        str | None,
        typer.Option(help="Numbers in the stores: f16 is half as large to fetch as f32; default: the scene's."),
    ] = None,
) -> None:
    """Write a scene as a static site: page and WebAssembly, for any web host.

    Example: palpate web scene.toml site, then python -m http.server -d site
    """
    from palpate.scene import Scene
    from palpate.viewer.site import with_precision, write_site

    read = Scene.of_store(scene) if scene.suffix == ".palpate" else Scene.read(scene)
    built = (read if precision is None else with_precision(read, precision)).build()
    sizes = write_site([(read.name, built)], out)
    program = sizes.pop("program")
    error = max(body.green._core.typical_errors[0] for body in built.bodies)
    size = sum(sizes.values())
    print(f"{out}: program {program / 1e6:.1f} MB, scene {size / 1e6:.1f} MB; forces right to {100 * error:.2g} %")
    print(f"python -m http.server -d {out}")
