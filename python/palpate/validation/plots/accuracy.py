"""Plots of errors and stiffness against element size, as PNG."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.figures import COLORS, empty_figure, write_figure


def plot_convergence(
    series: Mapping[str, tuple[np.ndarray, np.ndarray]], orders: Mapping[str, int], path: Path
) -> None:
    """Relative errors against element size over the body's size, with the slopes that theory expects."""
    figure = empty_figure(6.5, 4.5)
    axes = figure.subplots()
    for (name, (size, error)), color in zip(series.items(), COLORS, strict=False):
        observed = np.log(error[-2] / error[-1]) / np.log(size[-2] / size[-1])
        axes.loglog(size, error, "o-", color=color, label=f"{name}: order {observed:.2f}")
        slope = error[-1] * (size / size[-1]) ** orders[name]
        axes.loglog(size, slope, "--", color="0.6", linewidth=0.9, zorder=0)
    axes.set(xlabel="element size / size of the body", ylabel="relative error of displacement, L2")
    axes.set_title("a smooth displacement; dashed: orders 2 and 3", loc="left")
    axes.legend(frameon=False)
    write_figure(figure, path)


def plot_felt_stiffness(
    series: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]], limit: float, path: Path
) -> None:
    """Stiffness, N/m, of a patch and of one node against node spacings along an edge: (name: spacings, patch, node)."""
    figure = empty_figure(6.5, 4.5)
    axes = figure.subplots()
    axes.axhline(limit, color="0.5", linewidth=0.9, linestyle="--", label="patch, converged")
    for (name, (nodes, patch, node)), color in zip(series.items(), COLORS, strict=False):
        axes.plot(nodes, patch, "o-", color=color, label=f"patch, {name}")
        axes.plot(nodes, node, "s:", color=color, markersize=4, label=f"single node, {name}")
    axes.set(xlabel="node spacings along an edge of the cube", ylabel="felt stiffness [N/m]", ylim=(0, None))
    axes.set_title("only a patch has a stiffness of its own", loc="left")
    axes.legend(frameon=False)
    write_figure(figure, path)
