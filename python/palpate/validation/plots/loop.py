"""Plots of the force loop's times, as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.figures import COLORS, empty_figure, write_figure

# A fifth kind needs a fifth colour.
SHADES = (*COLORS, "tab:orange")
PERIOD_US = 1000.0


def plot_envelope(
    laws: Sequence[str], kinds: Sequence[str], rows: Sequence[Mapping[str, Any]], largest: int, path: Path
) -> None:
    """Draw times against contacts by kind of tick, against the nodes of the body, and those of the running loop.

    Parameters
    ----------
    laws, kinds
        Columns of the plot, and kinds of ticks.
    rows
        ``law``, ``nodes``, ``contacts``; ``kinds``: median, 99.9th percentile and costliest place of each, us;
        ``compute`` and ``wakeup`` of the running loop: median, 99.9th percentile and worst, us, or None.
    largest
        Surface nodes of the largest body.
    path
        PNG to write.

    """
    loops = any(row["compute"] for row in rows)
    figure = empty_figure(4.0 * len(laws) + 0.8, 3.6 * (2 + loops))
    axes = figure.subplots(2 + loops, len(laws), sharey="row", squeeze=False)
    for column, law in enumerate(laws):
        of_law = [row for row in rows if row["law"] == law]
        on_largest = sorted((row for row in of_law if row["nodes"] == largest), key=lambda row: row["contacts"])
        _by_kind(axes[0, column], kinds, on_largest, f"contact = {law}, {largest} surface nodes")
        _by_nodes(axes[1, column], of_law)
        if loops:
            _running(axes[2, column], on_largest)
    for row, label in zip(axes, ("a tick [us]", "a tick [us]", "running loop [us]"), strict=False):
        row[0].set_ylabel(label)
        row[-1].legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    write_figure(figure, path)


def _logarithmic(axes: Any, ticks: Sequence[int], label: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlabel(label)
    axes.axhline(PERIOD_US, color="0.3", linewidth=1, linestyle=":")


def _by_kind(axes: Any, kinds: Sequence[str], rows: Sequence[Mapping[str, Any]], title: str) -> None:
    counts = [row["contacts"] for row in rows]
    for kind, color in zip(kinds, SHADES, strict=False):
        median, _, most = np.array([row["kinds"][kind] for row in rows]).T
        axes.plot(counts, median, "o-", color=color, markersize=4, label=f"{kind}: median")
        axes.plot(counts, most, "^:", color=color, markersize=4, linewidth=1, label="   costliest place")
    _logarithmic(axes, counts, "contacts")
    axes.set_title(title, loc="left", fontsize=10)


def _by_nodes(axes: Any, rows: Sequence[Mapping[str, Any]]) -> None:
    counts = sorted({row["contacts"] for row in rows})
    for count, color in zip(counts, SHADES, strict=False):
        chosen = sorted((row for row in rows if row["contacts"] == count), key=lambda row: row["nodes"])
        nodes = [row["nodes"] for row in chosen]
        name = f"{count} contact{'s' if count > 1 else ''}"
        axes.plot(nodes, [row["kinds"]["sliding"][0] for row in chosen], "o-", color=color, markersize=4, label=name)
        high = [max(of_kind[1] for of_kind in row["kinds"].values()) for row in chosen]
        axes.plot(nodes, high, "^:", color=color, markersize=4, linewidth=1, label="   p99.9 of any kind")
    _logarithmic(axes, sorted({row["nodes"] for row in rows}), "surface nodes (line: median of sliding)")


def _running(axes: Any, rows: Sequence[Mapping[str, Any]]) -> None:
    counts = [row["contacts"] for row in rows]
    for name, color in (("compute", COLORS[1]), ("wakeup", COLORS[0])):
        for values, style, label in zip(
            np.array([row[name] for row in rows]).T, ("o-", "s--", "^:"), ("median", "p99.9", "worst"), strict=True
        ):
            axes.plot(counts, values, style, color=color, markersize=4, linewidth=1.2, label=f"{name}: {label}")
    _logarithmic(axes, counts, "contacts")


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
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("time from a deadline to the begin of its tick [us]")
    axes.set_ylabel("ticks")
    axes.set_title(title, loc="left")
    axes.legend(edgecolor="none")
    write_figure(figure, path)
