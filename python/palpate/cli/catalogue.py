"""The command that lists the built-in models."""

from __future__ import annotations

from palpate import models
from palpate.cli.app import app
from palpate.mesh import TetMesh


@app.command("models")
def models_command() -> None:
    """List the built-in models, beside the paper's own counts.

    Example: palpate models
    """
    from rich.console import Console
    from rich.table import Table

    console = Console()
    fine = Table("model", "size in mm", "element", title="Built-in models")
    paper = Table("model", "", "element", title="In the sizes of the paper (--paper)")
    for table in (fine, paper):
        for column in ("nodes", "tetrahedra", "surface nodes", "triangles"):
            table.add_column(column, justify="right")
    for name in models.NAMES:
        mesh = models.load(name)
        size = " x ".join(f"{1e3 * s:.0f}" for s in mesh.bounds[1] - mesh.bounds[0])
        fine.add_row(name, size, _element(mesh), *map(str, _counts(mesh)))
    for name, published in models.PAPER.items():
        theirs = (published.nodes, published.tets, published.surface_nodes, published.surface_triangles)
        ours = models.load(name, paper=True)
        paper.add_row(name, "ours", _element(ours), *map(str, _counts(ours)))
        paper.add_row("", "paper's", "4 nodes", *("-" if n is None else str(n) for n in theirs), end_section=True)
    console.print(fine)
    console.print(paper)
    for name, published in models.PAPER.items():
        if published.note:
            console.print(f"{name}: {published.note}")


def _element(mesh: TetMesh) -> str:
    return f"{mesh.tets.shape[1]} nodes"


def _counts(mesh: TetMesh) -> tuple[int, int, int, int]:
    return len(mesh.nodes), len(mesh.tets), len(mesh.surface_nodes), len(mesh.surface_triangles)
