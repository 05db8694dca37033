"""The command that writes a scene for programs without Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.app import app


@app.command()
def pack(
    scene: Annotated[Path, typer.Argument(help="A scene file (.toml), or a precomputed store.")],
    out: Annotated[Path, typer.Argument(help="Folder to write; an earlier packed scene there is replaced.")],
) -> None:
    """Write a scene as a folder that programs in C, C++ or Rust load without Python.

    Example: palpate pack scene.toml liver.pack
    """
    from palpate import simulation
    from palpate.cli.checks import scene_of_file
    from palpate.units import count_text

    read = scene_of_file(scene)
    simulation.pack(read, out)
    size = sum(file.stat().st_size for file in out.iterdir())
    counts = f"{count_text(len(read.bodies), 'body', 'bodies')}, {count_text(len(read.tools), 'tool')}"
    print(f"{out}: {counts}, {size / 1e6:.1f} MB")
