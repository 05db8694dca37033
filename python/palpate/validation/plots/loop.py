"""Plots of the force loop's times, as PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.figures import COLORS, empty_figure, write_figure

PERIOD_US = 1000.0


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
