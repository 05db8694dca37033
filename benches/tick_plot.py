"""Plot of the envelope of the force loop, as PNG."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benches.tick_case import Row
from palpate.figures import COLORS, empty_figure, write_figure
from palpate.validation.ticks import KINDS

# A fifth kind needs a fifth colour.
SHADES = (*COLORS, "tab:orange")
PERIOD_US = 1000.0


def plot_envelope(rows: Sequence[Row], path: Path) -> None:
    """Draw times against contacts by kind of tick, against the nodes of the body, and those of the running loop."""
    laws = sorted({row.labels["law"] for row in rows})
    largest = max(row.labels["surface nodes"] for row in rows)
    loops = any(row.labels["tick"] not in KINDS for row in rows)
    figure = empty_figure(4.0 * len(laws) + 0.8, 3.6 * (2 + loops))
    axes = figure.subplots(2 + loops, len(laws), sharey="row", squeeze=False)
    for column, law in enumerate(laws):
        of_law = [row for row in rows if row.labels["law"] == law]
        on_largest = [row for row in of_law if row.labels["surface nodes"] == largest]
        _by_kind(axes[0, column], on_largest, f"contact = {law}, {largest} surface nodes")
        _by_nodes(axes[1, column], of_law)
        if loops:
            _running(axes[2, column], on_largest)
    for row, label in zip(axes, ("a tick [us]", "a tick [us]", "running loop [us]"), strict=False):
        row[0].set_ylabel(label)
        row[-1].legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    write_figure(figure, path)


def _drawn(axes: Any, by: str, rows: Sequence[Row], figures: Sequence[tuple[str, str, str]], color: str) -> None:
    """Draw figures of rows, each with a style and a label, against one of their labels."""
    rows = sorted(rows, key=lambda row: row.labels[by])
    for figure, style, label in figures:
        values = [getattr(row, figure) for row in rows]
        axes.plot(
            [row.labels[by] for row in rows], values, style, color=color, markersize=4, linewidth=1.2, label=label
        )


def _logarithmic(axes: Any, by: str, rows: Sequence[Row], label: str) -> None:
    ticks = sorted({row.labels[by] for row in rows})
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlabel(label)
    axes.axhline(PERIOD_US, color="0.3", linewidth=1, linestyle=":")


def _by_kind(axes: Any, rows: Sequence[Row], title: str) -> None:
    for kind, color in zip(KINDS, SHADES, strict=True):
        figures = [("median", "o-", f"{kind}: median"), ("costliest", "^:", "   costliest place")]
        _drawn(axes, "contacts", [row for row in rows if row.labels["tick"] == kind], figures, color)
    _logarithmic(axes, "contacts", rows, "contacts")
    axes.set_title(title, loc="left", fontsize=10)


def _by_nodes(axes: Any, rows: Sequence[Row]) -> None:
    for count, color in zip(sorted({row.labels["contacts"] for row in rows}), SHADES, strict=False):
        ticks = [row for row in rows if row.labels["contacts"] == count and row.labels["tick"] in KINDS]
        name = f"{count} contact{'s' if count > 1 else ''}"
        sliding = [row for row in ticks if row.labels["tick"] == "sliding"]
        _drawn(axes, "surface nodes", sliding, [("median", "o-", name)], color)
        # The kind with the largest p99.9 at each number of nodes.
        highest = {row.labels["surface nodes"]: row for row in sorted(ticks, key=lambda row: row.p999 or 0.0)}
        _drawn(axes, "surface nodes", list(highest.values()), [("p999", "^:", "   p99.9 of any kind")], color)
    _logarithmic(axes, "surface nodes", rows, "surface nodes (line: median of sliding)")


def _running(axes: Any, rows: Sequence[Row]) -> None:
    for name, color in (("computing", COLORS[1]), ("waking up", COLORS[0])):
        styles = zip(("median", "p999", "worst"), ("o-", "s--", "^:"), ("median", "p99.9", "worst"), strict=True)
        figures = [(figure, style, f"{name}: {label}") for figure, style, label in styles]
        _drawn(axes, "contacts", [row for row in rows if row.labels["tick"] == f"running: {name}"], figures, color)
    _logarithmic(axes, "contacts", rows, "contacts")
