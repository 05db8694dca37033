"""Logs and histories of sessions: plots as PNG, columns as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from palpate.atomic import written_beside
from palpate.figures import empty_figure, write_figure


def plot_log(log: np.ndarray, path: Path, title: str) -> None:
    """Force on the device and tick times against time; written beside and renamed."""
    figure = empty_figure(9, 6)
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
    lower.set(yscale="log", ylabel="time of a tick [us]", xlabel="time [s]")
    lower.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=2, frameon=False)
    write_figure(figure, path)


def plot_history(time: np.ndarray, displacements: np.ndarray, path: Path, title: str) -> None:
    """Displacement (t, 3), m, of one node against time, s; written beside and renamed."""
    figure = empty_figure(9, 4.5)
    axes = figure.subplots()
    for axis, color in enumerate(("tab:red", "tab:green", "tab:blue")):
        axes.plot(time, 1e3 * displacements[:, axis], color=color, linewidth=1.3, label="xyz"[axis])
    axes.set(ylabel="displacement [mm]", xlabel="time [s]")
    axes.set_title(title, loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False)
    write_figure(figure, path)


def write_log(log: np.ndarray, depth: np.ndarray, strain: np.ndarray, path: Path) -> None:
    """Write the 1 kHz log as CSV, with depth (m) and strain of each row; beside, then renamed."""
    names = ("time_s", "x_m", "y_m", "z_m", "fx_N", "fy_N", "fz_N", "depth_m", "strain", "compute_us", "wakeup_us")
    moved = [log["time"], *log["position"].T, *log["force"].T]
    write_columns(names, [*moved, depth, strain, log["compute_us"], log["wakeup_us"]], path)


def write_columns(names: Sequence[str], columns: Sequence[np.ndarray], path: Path) -> None:
    """Write columns as CSV with a header; beside, then renamed."""
    with written_beside(path) as partial:
        np.savetxt(partial, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.9g")
