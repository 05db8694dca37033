"""The built-in models as scenes and as a table."""

from __future__ import annotations

from palpate import models
from palpate.errors import SceneError
from palpate.scene import Scene

# Size of a fingertip against each model, m; and its stiffness, Pa: organs about as published for fresh tissue
# (liver and kidney some kPa to tens of kPa), the others soft rubber.
TOOLS = {"doll": 8e-3, "kidney": 5e-3, "liver": 8e-3, "beam": 5e-3}
YOUNGS_MODULUS = {"doll": 10e3, "kidney": 15e3, "liver": 8e3, "beam": 20e3}


def model_scene(name: str, paper: bool = False) -> Scene:
    """Scene of a built-in model, held by its own supports.

    Raises
    ------
    SceneError
        No model of that name.

    """
    if name not in models.NAMES:
        raise SceneError(f"there is no model '{name}'; there are {', '.join(models.NAMES)}")
    tool = {"radius": TOOLS[name], "contact_radius": TOOLS[name]}
    return Scene(body={"model": name, "paper": paper}, material={"youngs_modulus": YOUNGS_MODULUS[name]}, tool=tool)


def print_models() -> None:
    """Table of the models, their sizes and the paper's."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Built-in models (the paper's own counts in brackets)")
    for column in ("model", "size mm", "nodes", "tetrahedra", "surface nodes", "triangles"):
        table.add_column(column, justify="left" if column == "model" else "right")
    for name in models.NAMES:
        _add_row(table, name, False)
    table.add_section()
    for name in models.PAPER:
        _add_row(table, name, True)
    console = Console()
    console.print(table)
    for name, paper in models.PAPER.items():
        if paper.note:
            console.print(f"{name} --paper: {paper.note}")


def _add_row(table, name: str, paper: bool) -> None:
    mesh = models.load(name, paper=paper)
    ours = (len(mesh.nodes), len(mesh.tets), len(mesh.surface_nodes), len(mesh.surface_triangles))
    published = models.PAPER[name]
    theirs = (published.nodes, published.tets, published.surface_nodes, published.surface_triangles)
    size = " x ".join(f"{1e3 * s:.0f}" for s in mesh.bounds[1] - mesh.bounds[0])
    cells = [f"{a} ({b if b is not None else '-'})" if paper else str(a) for a, b in zip(ours, theirs, strict=True)]
    table.add_row(f"{name} --paper" if paper else name, size, *cells)
