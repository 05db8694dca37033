"""Plots of contact forces, as PNG."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.figures import COLORS, empty_figure, write_figure

Curve = tuple[np.ndarray, np.ndarray]


def plot_pressing(curves: Mapping[str, Curve], truth: Curve, name: str, path: Path) -> None:
    """Force, N, against depth, m: curves, and what is right as circles."""
    figure = empty_figure(6.5, 4.5)
    axes = figure.subplots()
    for (label, (depth, force)), color in zip(curves.items(), COLORS, strict=False):
        axes.plot(1e3 * depth, force, color=color, linewidth=1.6, label=label)
    axes.plot(1e3 * truth[0], truth[1], "o", color="0.1", markerfacecolor="none", markersize=8, label=name)
    axes.set(xlabel="depth of the sphere [mm]", ylabel="force [N]", xlim=(0, None), ylim=(0, None))
    axes.set_title("a rigid sphere, R = 10 mm, in a block of 10 kPa", loc="left")
    axes.legend(frameon=False)
    write_figure(figure, path)


def plot_partial_slip(shifts: np.ndarray, forces: np.ndarray, exact: np.ndarray, path: Path) -> None:
    """Sideways force, N, against sideways displacement, m, of a pressed sphere, beside Mindlin's."""
    figure = empty_figure(6.5, 4.0)
    axes = figure.subplots()
    axes.plot(1e3 * shifts, exact, "--", color="0.4", linewidth=1.2, label="Mindlin 1949")
    axes.plot(1e3 * shifts, forces, color=COLORS[1], linewidth=1.8, label="Palpate, in the tick")
    axes.set(xlabel="sideways displacement [mm]", ylabel="sideways force [N]")
    axes.set_title("from sticking to slipping, friction 0.3", loc="left")
    axes.legend(frameon=False)
    write_figure(figure, path)
