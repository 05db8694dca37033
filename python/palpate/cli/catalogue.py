"""The built-in models as scenes and as a table."""

from __future__ import annotations

from palpate import models
from palpate.errors import SceneError
from palpate.mesh import TetMesh
from palpate.scene import Scene

# Size of a fingertip against each model, m; and its stiffness, Pa: organs about as published for fresh tissue
# (liver and kidney some kPa to tens of kPa), the others soft rubber.
TOOLS = {"doll": 8e-3, "kidney": 5e-3, "liver": 8e-3, "beam": 5e-3}
YOUNGS_MODULUS = {"doll": 10e3, "kidney": 15e3, "liver": 8e3, "beam": 20e3}
# Modes of a body in motion, by whether it has the paper's size: all of a small one, the lowest of a fine one.
MODES = {True: {"modes": "all"}, False: {"modes": 200}}
# Parts of critical damping of the first and the tenth mode: a struck body swings for some seconds.
DAMPING_RATIOS = (0.03, 0.03)


def model_scene(name: str, paper: bool = False, motion: bool = False) -> Scene:
    """Scene of a built-in model, held by its own supports; with ``motion`` it moves.

    Raises
    ------
    SceneError
        No model of that name.

    """
    if name not in models.NAMES:
        raise SceneError(f"there is no model '{name}'; there are {', '.join(models.NAMES)}")
    tool = {"radius": TOOLS[name], "contact_radius": TOOLS[name]}
    return Scene(
        body={"model": name, "paper": paper},
        material={"youngs_modulus": YOUNGS_MODULUS[name]},
        tool=tool,
        dynamics={**MODES[paper], "damping_ratios": DAMPING_RATIOS} if motion else None,
    )


def print_models() -> None:
    """Tables of the models: what the demo shows, and those in the paper's sizes beside its own counts."""
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
