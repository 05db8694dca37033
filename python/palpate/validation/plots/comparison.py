"""Forces of two recordings over time, and their difference, as PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.figures import COLORS, empty_figure, write_figure
from palpate.simulation import Recording


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
