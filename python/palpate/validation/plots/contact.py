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
    axes.set_xlabel("depth of the sphere [mm]")
    axes.set_ylabel("force [N]")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.set_title("a rigid sphere, R = 10 mm, in a block of 10 kPa", loc="left")
    axes.legend(frameon=False)
    write_figure(figure, path)


def plot_partial_slip(shifts: np.ndarray, forces: np.ndarray, exact: np.ndarray, path: Path) -> None:
    """Sideways force, N, against sideways displacement, m, of a pressed sphere, beside Mindlin's."""
    figure = empty_figure(6.5, 4.0)
    axes = figure.subplots()
    axes.plot(1e3 * shifts, exact, "--", color="0.4", linewidth=1.2, label="Mindlin 1949")
    axes.plot(1e3 * shifts, forces, color=COLORS[1], linewidth=1.8, label="Palpate, in the tick")
    axes.set_xlabel("sideways displacement [mm]")
    axes.set_ylabel("sideways force [N]")
    axes.set_title("from sticking to slipping, friction 0.3", loc="left")
    axes.legend(frameon=False)
    write_figure(figure, path)


def plot_contact(depths: np.ndarray, truth: np.ndarray, series: Mapping[str, np.ndarray], path: Path) -> None:
    """Force, N, against depth (n,), m: the truth (n,), and methods (places, n) by the range of their places."""
    figure = empty_figure(7.5, 5.0)
    axes = figure.subplots()
    fine = np.linspace(0, depths[-1], 100)
    power = np.exp(np.interp(np.log(np.maximum(fine, depths[0])), np.log(depths), np.log(truth)))
    power[fine < depths[0]] = truth[0] * (fine[fine < depths[0]] / depths[0]) ** 1.5
    axes.plot(1e3 * fine, power, color="0.1", linewidth=5, alpha=0.35, label="right: resolved mesh, solved directly")
    for (name, forces), color in zip(series.items(), (COLORS[1], COLORS[0], COLORS[3]), strict=False):
        own = name.startswith("Palpate")
        x = 1e3 * np.concatenate([[0.0], depths])
        low, mean, high = (np.concatenate([[0.0], of(forces, axis=0)]) for of in (np.min, np.mean, np.max))
        axes.fill_between(x, low, high, color=color, alpha=0.2, linewidth=0)
        axes.plot(x, mean, "o-", color=color, markersize=4, linewidth=1.8 if own else 1.3, label=name)
    axes.set_xlabel("depth of the sphere [mm]")
    axes.set_ylabel("force [N]")
    axes.set_xlim(0, 1.02e3 * depths[-1])
    axes.set_ylim(bottom=0)
    axes.set_title("a rigid sphere, R = 10 mm, pressed into elements of 10 mm, E = 10 kPa", loc="left")
    axes.legend(frameon=False, loc="upper left", title="band: places of an element", alignment="left")
    write_figure(figure, path)
