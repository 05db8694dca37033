"""Plots of sessions and measurements, as PNG."""

from palpate.figures import COLORS, empty_figure, write_figure
from palpate.validation.plots.accuracy import plot_convergence, plot_felt_stiffness
from palpate.validation.plots.comparison import plot_comparison
from palpate.validation.plots.contact import plot_partial_slip, plot_pressing
from palpate.validation.plots.loop import plot_wakeups
from palpate.validation.plots.sessions import plot_history, plot_log, write_columns, write_log

__all__ = [
    "COLORS",
    "empty_figure",
    "plot_comparison",
    "plot_convergence",
    "plot_felt_stiffness",
    "plot_history",
    "plot_log",
    "plot_partial_slip",
    "plot_pressing",
    "plot_wakeups",
    "write_columns",
    "write_figure",
    "write_log",
]
