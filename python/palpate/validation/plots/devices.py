"""Plots of what devices hold, as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from palpate.figures import empty_figure, write_figure


def plot_z_width(rows: Sequence[Mapping[str, float]], damping: float, period: float, path: Path) -> None:
    """Draw the largest stable stiffness against delay for each mass, and its ratio to that for any hand.

    Parameters
    ----------
    rows
        ``mass``, kg, ``delay``, s; ``any_hand``, ``eigenvalue`` and ``bare``, N/m.
    damping, period
        Of all of them, N s/m and s.
    path
        PNG to write.

    """
    from matplotlib import colormaps

    figure = empty_figure(10.0, 4.2)
    left, right = figure.subplots(1, 2)
    masses = sorted({row["mass"] for row in rows})
    shades = colormaps["viridis"](np.linspace(0.0, 0.9, len(masses)))
    delays = np.linspace(0.0, max(row["delay"] for row in rows), 200)
    left.plot(1e3 * delays, damping / (period / 2 + delays), "k--", linewidth=1, label="b / (T/2 + d)")
    for mass, shade in zip(masses, shades, strict=True):
        chosen = sorted((row for row in rows if row["mass"] == mass), key=lambda row: row["delay"])
        delay = [1e3 * row["delay"] for row in chosen]
        left.plot(delay, [row["eigenvalue"] for row in chosen], color=shade, linewidth=1)
        left.plot(delay, [row["bare"] for row in chosen], "o", color=shade, markersize=4, label=f"{1e3 * mass:g} g")
        right.plot(delay, [row["eigenvalue"] / row["any_hand"] for row in chosen], color=shade, linewidth=1)
        right.plot(delay, [row["bare"] / row["any_hand"] for row in chosen], "o", color=shade, markersize=4)
    left.set_yscale("log")
    left.set_ylabel("largest stable stiffness [N/m]")
    left.legend(frameon=False, fontsize=8, title="measured; lines: eigenvalues", title_fontsize=8)
    right.axhline(1.0, color="k", linestyle="--", linewidth=1)
    right.set_ylabel("over b / (T/2 + d)")
    for axes in (left, right):
        axes.set_xlabel("delay [ms]")
    left.set_title(f"a device of b = {damping:g} N s/m at {1 / period:g} Hz, no hand", fontsize=9)
    write_figure(figure, path)
