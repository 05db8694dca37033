"""Plot of what grows with a body, as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from palpate.figures import empty_figure, write_figure


def plot_scaling(
    counts: Sequence[int],
    stages: Mapping[str, Sequence[float | None]],
    sizes: Mapping[str, Sequence[int]],
    rates: Mapping[str, Sequence[float]],
    path: Path,
) -> None:
    """Draw three logarithmic plots side by side against numbers of tetrahedra.

    Parameters
    ----------
    counts
        Tetrahedra.
    stages
        Seconds of all processors of each stage, None where there was none; the last is drawn thick, that before it, on
        the wall, dotted.
    sizes
        Memory and files, bytes.
    rates
        Ticks and frames, us.
    path
        PNG to write.

    """
    from matplotlib import colormaps

    figure = empty_figure(17.0, 4.8)
    left, middle, right = figure.subplots(1, 3)
    *_, wall, last = stages
    special = {wall: {"color": "black", "linestyle": ":"}, last: {"color": "black", "linewidth": 2.4}}
    for rank, (name, values) in enumerate(stages.items()):
        known = [(count, value) for count, value in zip(counts, values, strict=True) if value]
        if known:
            style = special.get(name, {"color": colormaps["tab20"](rank)})
            left.plot(*zip(*known, strict=True), marker="o", markersize=4, label=name, **style)
    for name, values in sizes.items():
        style = "^:" if name == "planned" else "o-"
        middle.plot(counts, [value / 1e6 for value in values], style, markersize=5, label=name)
    for name, values in rates.items():
        right.plot(counts, values, "o-", markersize=4, label=name)
    for axes, label in ((left, "s of all processors"), (middle, "MB"), (right, "us")):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("tetrahedra")
        axes.set_ylabel(label)
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(
            frameon=False, fontsize=8, **({"loc": "upper left", "bbox_to_anchor": (1, 1)} if axes is left else {})
        )
    write_figure(figure, path)
