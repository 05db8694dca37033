"""Plots of sessions and measurements, as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.atomic import written_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from palpate.bench.elements import Row


def plot_log(log: np.ndarray, path: Path, title: str) -> None:
    """Force on the device and tick times against time; written beside and renamed."""
    figure = _figure(9, 6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    time, force = log["time"], log["force"]
    upper.plot(time, np.linalg.norm(force, axis=1), color="0.15", linewidth=1.8, label="magnitude")
    for axis, color in enumerate(("tab:red", "tab:green", "tab:blue")):
        upper.plot(time, force[:, axis], color=color, linewidth=1.0, label="xyz"[axis])
    upper.set_ylabel("force on the device [N]")
    upper.set_title(title, loc="left")
    upper.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, frameon=False)
    lower.plot(time, log["compute_us"], color="tab:purple", linewidth=0.8, label="computing")
    lower.plot(time, log["wakeup_us"], color="0.6", linewidth=0.6, label="wake-up delay", zorder=0)
    lower.set_yscale("log")
    lower.set_ylabel("time of a tick [us]")
    lower.set_xlabel("time [s]")
    lower.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=2, frameon=False)
    _finish(figure, path)


def plot_history(time: np.ndarray, displacements: np.ndarray, path: Path, title: str) -> None:
    """Displacement (t, 3), m, of one node against time, s; written beside and renamed."""
    figure = _figure(9, 4.5)
    axes = figure.subplots()
    for axis, color in enumerate(("tab:red", "tab:green", "tab:blue")):
        axes.plot(time, 1e3 * displacements[:, axis], color=color, linewidth=1.3, label="xyz"[axis])
    axes.set_ylabel("displacement [mm]")
    axes.set_xlabel("time [s]")
    axes.set_title(title, loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False)
    _finish(figure, path)


def plot_convergence(
    series: Mapping[str, tuple[np.ndarray, np.ndarray]], orders: Mapping[str, int], path: Path
) -> None:
    """Relative errors against element size over the body's size, with the slopes that theory expects."""
    figure = _figure(6.5, 4.5)
    axes = figure.subplots()
    for (name, (size, error)), color in zip(series.items(), COLORS, strict=False):
        observed = np.log(error[-2] / error[-1]) / np.log(size[-2] / size[-1])
        axes.loglog(size, error, "o-", color=color, label=f"{name}: order {observed:.2f}")
        slope = error[-1] * (size / size[-1]) ** orders[name]
        axes.loglog(size, slope, "--", color="0.6", linewidth=0.9, zorder=0)
    axes.set_xlabel("element size / size of the body")
    axes.set_ylabel("relative error of displacement, L2")
    axes.set_title("a smooth displacement; dashed: orders 2 and 3", loc="left")
    axes.legend(frameon=False)
    _finish(figure, path)


def plot_felt_stiffness(
    series: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]], limit: float, path: Path
) -> None:
    """Stiffness, N/m, of a patch and of one node against node spacings along an edge: (name: spacings, patch, node)."""
    figure = _figure(6.5, 4.5)
    axes = figure.subplots()
    axes.axhline(limit, color="0.5", linewidth=0.9, linestyle="--", label="patch, converged")
    for (name, (nodes, patch, node)), color in zip(series.items(), COLORS, strict=False):
        axes.plot(nodes, patch, "o-", color=color, label=f"patch, {name}")
        axes.plot(nodes, node, "s:", color=color, markersize=4, label=f"single node, {name}")
    axes.set_xlabel("node spacings along an edge of the cube")
    axes.set_ylabel("felt stiffness [N/m]")
    axes.set_ylim(bottom=0)
    axes.set_title("only a patch has a stiffness of its own", loc="left")
    axes.legend(frameon=False)
    _finish(figure, path)


def plot_elements(rows: Sequence[Row], path: Path) -> None:
    """Error of the felt stiffness against the price of precomputing, one line an element and Poisson's ratio."""
    figure = _figure(9, 4.5)
    left, right = figure.subplots(1, 2, sharey=True)
    for nodes, style in ((4, "o--"), (10, "s-")):
        chosen = [row for row in rows if row.body == "cube" and row.element_nodes == nodes]
        for nu, color in zip(chosen[0].errors, COLORS, strict=False):
            errors = [abs(100 * row.errors[nu]) for row in chosen]
            label = f"{nodes} nodes, nu {nu}"
            left.loglog([row.precompute_cpu_s for row in chosen], errors, style, color=color, label=label)
            right.loglog([1e-6 * row.store_bytes for row in chosen], errors, style, color=color)
    left.set_ylabel("error of the felt stiffness [%]")
    left.set_xlabel("precomputing, processor time [s]")
    right.set_xlabel("store [MB]")
    left.set_title("a patch on a cube, all of it touchable", loc="left")
    left.legend(frameon=False)
    _finish(figure, path)


COLORS = ("tab:red", "tab:blue", "tab:green", "tab:purple")


def _figure(width: float, height: float) -> Figure:
    """Make a figure of so many inches that needs no screen."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _finish(figure: Figure, path: Path) -> None:
    """Light grid, open frame; written beside and renamed."""
    for axes in figure.axes:
        _lighten(axes)
    with written_beside(path) as partial:
        figure.savefig(partial, format="png")


def _lighten(axes: Axes) -> None:
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def write_log(log: np.ndarray, path: Path) -> None:
    """Write the 1 kHz log as CSV with units in the header; beside, then renamed."""
    names = ("time_s", "x_m", "y_m", "z_m", "fx_N", "fy_N", "fz_N", "compute_us", "wakeup_us")
    columns = [log["time"], *log["position"].T, *log["force"].T, log["compute_us"], log["wakeup_us"]]
    write_columns(names, columns, path)


def write_columns(names: Sequence[str], columns: Sequence[np.ndarray], path: Path) -> None:
    """Write columns as CSV with a header; beside, then renamed."""
    with written_beside(path) as partial:
        np.savetxt(partial, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.9g")
