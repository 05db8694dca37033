"""Plot of a study: stiffness against each varied value."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from palpate.figures import COLORS, empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A range this wide is drawn on a logarithmic axis.
WIDE = 5.0
# Beyond so many texts along an axis they are turned.
LEVEL_TEXTS = 4


def picture_of_study(columns: Mapping[str, np.ndarray], varied: Sequence[str]) -> Figure:
    """Draw a panel for each varied value: bodies that agree in all others are joined, a colour for each press.

    Under loads of its own a body has no stiffness; the force is drawn then.
    """
    stiffness = columns["stiffness_N_per_m"].astype(float)
    name, values = "stiffness (N/m)", stiffness
    if not np.isfinite(stiffness).any():
        name, values = "force (N)", columns["force_N"].astype(float)
    panels = [key for key in varied if len(np.unique(columns[key])) > 1] or ["case"]
    figure = empty_figure(4.2 * len(panels), 3.6)
    axes = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    presses = list(dict.fromkeys(columns["press"].tolist()))
    for panel, key in zip(axes, panels, strict=True):
        others = [columns[other] for other in varied if other != key] if key != "case" else []
        for press, color in zip(presses, itertools.cycle(COLORS), strict=False):
            _lines(panel, columns, key, others, values, columns["press"] == press, color, press)
        _scale(panel.set_xscale, columns[key])
        panel.set_xlabel(key)
    _scale(axes[0].set_yscale, values)
    axes[0].set_ylabel(name)
    if len(presses) > 1:
        axes[0].legend(frameon=False)
    return figure


def _lines(
    panel: Axes,
    columns: Mapping[str, np.ndarray],
    key: str,
    others: Sequence[np.ndarray],
    values: np.ndarray,
    chosen: np.ndarray,
    color: object,
    label: str,
) -> None:
    """Draw the bodies of a press, joined where all values but that of ``key`` agree."""
    lines: dict[tuple, list[int]] = {}
    for row in np.flatnonzero(chosen & np.isfinite(values)):
        lines.setdefault(tuple(other[row] for other in others), []).append(int(row))
    places = columns[key]
    if places.dtype.kind not in "fi":
        texts = np.unique(places)
        places = np.searchsorted(texts, places)
        panel.set_xticks(range(len(texts)), texts, rotation=30 if len(texts) > LEVEL_TEXTS else 0)
    for rank, rows in enumerate(lines.values()):
        ordered = sorted(rows, key=lambda row: places[row])
        named = label if rank == 0 else None
        panel.plot(places[ordered], values[ordered], "o-", color=color, ms=4, lw=1, alpha=0.8, label=named)


def _scale(choose: object, values: np.ndarray) -> None:
    """Take a logarithmic axis for positive numbers of a wide range."""
    if values.dtype.kind not in "fi":
        return
    finite = values[np.isfinite(values)]
    if len(finite) and finite.min() > 0 and finite.max() > WIDE * finite.min():
        choose("log")
