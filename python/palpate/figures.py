"""Style of all plots: colours, sizes, a light grid."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from palpate.atomic import written_beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = ("tab:red", "tab:blue", "tab:green", "tab:purple")


def empty_figure(width: float, height: float) -> Figure:
    """Make a figure of so many inches that needs no screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Figure, path: Path, *, grid: bool = True, kind: str = "png") -> None:
    """Light grid where one helps, open frame; written beside and renamed."""
    for axes in figure.axes if grid else ():
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    with written_beside(path) as partial:
        figure.savefig(partial, format=kind)
