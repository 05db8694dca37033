"""Plots of sessions, of the loop's times and of measurements beside known answers, as PNG; columns as CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from palpate.atomic import written_beside
from palpate.figures import COLORS, empty_figure, write_figure
from palpate.simulation import Recording

Curve = tuple[np.ndarray, np.ndarray]
# Of the loop's ticks.
PERIOD_US = 1000.0


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


def plot_comparison(a: Recording, b: Recording, names: tuple[str, str], path: Path) -> None:
    """Draw the forces on the devices of the tools and ticks that both have; written beside and renamed."""
    _, *rows = np.intersect1d(a.ticks, b.ticks, assume_unique=True, return_indices=True)
    forces = [one.forces.reshape(len(one.ticks), -1, 3)[row] for one, row in zip((a, b), rows, strict=True)]
    time, tools = a.time[rows[0]], min(forces[0].shape[1], forces[1].shape[1])
    figure = empty_figure(9, 5.5)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for tool, color in zip(range(tools), COLORS, strict=False):
        sizes = [np.linalg.norm(force[:, tool], axis=1) for force in forces]
        of = f", tool {tool}" if tools > 1 else ""
        upper.plot(time, sizes[0], color=color, linewidth=2.2, label=f"{names[0]}{of}")
        upper.plot(time, sizes[1], "--", color="0.1", linewidth=1.2, label=None if tool else names[1])
        difference = np.linalg.norm(forces[0][:, tool] - forces[1][:, tool], axis=1)
        lower.plot(time, difference, color=color, linewidth=1.2, label=f"tool {tool}")
    upper.set_ylabel("force on the device [N]")
    upper.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=tools + 1, frameon=False)
    lower.set(ylabel="difference [N]", xlabel="time [s]", ylim=(0, None))
    write_figure(figure, path)


def plot_wakeups(wakeup_us: np.ndarray, title: str, path: Path) -> None:
    """Histogram of wake-up delays (ticks,), us, in logarithmic bins, with the period marked."""
    figure = empty_figure(7.5, 4.0)
    axes = figure.subplots()
    low, high = max(0.1, float(wakeup_us.min())), max(2 * PERIOD_US, 1.1 * float(wakeup_us.max()))
    axes.hist(np.maximum(wakeup_us, low), bins=np.geomspace(low, high, 80), color=COLORS[1])
    axes.axvline(PERIOD_US, color="0.3", linewidth=1, linestyle=":", label="a period of 1 ms")
    for share, style in ((0.5, "-"), (0.999, "--")):
        value = float(np.quantile(wakeup_us, share))
        label = f"{'median' if share == 0.5 else 'p99.9'}: {value:.0f} us"
        axes.axvline(value, color=COLORS[0], linewidth=1.2, linestyle=style, label=label)
    axes.set(xscale="log", yscale="log", xlabel="time from a deadline to the begin of its tick [us]", ylabel="ticks")
    axes.set_title(title, loc="left")
    axes.legend(edgecolor="none")
    write_figure(figure, path)


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
