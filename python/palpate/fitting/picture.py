"""Picture of a fit: measured and computed curves above, residuals below."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.figures import COLORS, empty_figure, write_figure
from palpate.fitting.measurements import Indentations

# More names than these are not written into the picture.
MOST_NAMES = 8


def picture_of_fit(measured: Indentations, predicted: np.ndarray, used: np.ndarray, title: str, path: Path) -> None:
    """Draw forces (n,), N, and whether rows (n,) were used, into a file."""
    figure = empty_figure(6.4, 5.2)
    curves, residuals = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    largest = np.abs(measured.force).max()
    for k, name in enumerate(measured.names):
        rows = np.flatnonzero(measured.curve == k)
        rows = rows[np.argsort(measured.depth[rows])]
        color, depth = COLORS[k % len(COLORS)], 1e3 * measured.depth[rows]
        label = name if len(measured.names) <= MOST_NAMES else None
        curves.plot(depth, measured.force[rows], ".", color=color, ms=4, label=label)
        curves.plot(depth, predicted[rows], color=color, lw=1.4)
        left = ~used[rows]
        curves.plot(depth[left], measured.force[rows][left], "x", color="0.5", ms=5)
        residuals.plot(depth, 100 * (measured.force - predicted)[rows] / largest, ".", color=color, ms=4)
    residuals.axhline(0.0, color="0.4", lw=0.8)
    curves.set(ylabel="force (N)", title=title)
    curves.title.set_fontsize(9)
    residuals.set(xlabel="depth (mm)", ylabel="residual (% of largest)")
    curves.legend(frameon=False)
    write_figure(figure, path, kind=path.suffix[1:].lower())
