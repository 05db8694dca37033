"""Picture of an exam: its staircase, and the psychometric function of the hand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.exam.course import Course
from palpate.exam.psychometric import proportion_correct
from palpate.exam.result import Result, fraction_text, percent
from palpate.figures import COLORS, empty_figure, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

# Trials are put together where their felt contrasts differ by less than this ratio.
BIN = 1.35


def plot_exam(course: Course, result: Result, path: Path) -> None:
    """Staircase on the left, answers by contrast with the fitted function on the right, as PNG."""
    figure = empty_figure(9.5, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    asked = [answer for answer in course.answers if answer.trial.nodule is not None]
    felt = course.library.staircase_contrasts[[answer.trial.nodule for answer in asked]]
    scores = np.array([answer.score for answer in asked])
    _draw_staircase(left, np.array([answer.trial.number for answer in asked]), felt, scores, result)
    _draw_function(right, felt, scores, result)
    write_figure(figure, path)


def _draw_staircase(axes: Axes, numbers: np.ndarray, felt: np.ndarray, scores: np.ndarray, result: Result) -> None:
    axes.plot(numbers, 100 * felt, color="0.7", linewidth=1)
    kinds = ((scores == 1, COLORS[2], "o", "right"), (scores == 0, COLORS[0], "x", "wrong"))
    none = (scores > 0) & (scores < 1)
    for mask, color, marker, label in (*kinds, (none, COLORS[1], "s", "none")):
        if mask.any():
            axes.plot(numbers[mask], 100 * felt[mask], marker, color=color, markersize=5, label=label)
    seek = f"found in {percent(result.target)}"
    if np.isfinite(result.felt_contrast):
        axes.axhline(100 * result.felt_contrast, color="0.2", linewidth=1, linestyle="--", label=seek)
    _logarithmic(axes.yaxis)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set(xlabel="trial", ylabel="felt contrast dK/K [%]")
    axes.set_title("staircase", loc="left")
    axes.legend(frameon=False, loc="best")


def _logarithmic(axis: Axis) -> None:
    """Make an axis logarithmic, its numbers written out at 1, 2 and 5."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def _draw_function(axes: Axes, felt: np.ndarray, scores: np.ndarray, result: Result) -> None:
    estimate = result.estimate
    span = np.concatenate([felt, [estimate.weber_fraction]])
    fine = np.geomspace(0.7 * span.min(), 1.4 * span.max(), 200)
    if np.isfinite(estimate.high) and estimate.low > 0:
        chance = estimate.lapse_rate / estimate.alternatives
        ends = [
            chance + (1 - estimate.lapse_rate) * proportion_correct(fine, end, estimate.alternatives)
            for end in (estimate.low, estimate.high)
        ]
        axes.fill_between(100 * fine, *(100 * np.array(ends)), color=COLORS[1], alpha=0.15, linewidth=0)
    axes.plot(100 * fine, 100 * estimate.probability(fine), color=COLORS[1], linewidth=1.8)
    bins = np.round(np.log(felt) / np.log(BIN)).astype(int)
    for one in np.unique(bins):
        inside = bins == one
        place = 100 * np.exp(np.log(felt[inside]).mean())
        axes.plot(place, 100 * scores[inside].mean(), "o", color="0.15", markersize=2.5 + 1.3 * np.sqrt(inside.sum()))
    axes.axhline(100 / estimate.alternatives, color="0.5", linewidth=1, linestyle=":")
    axes.axvline(100 * estimate.weber_fraction, color=COLORS[1], linewidth=1, linestyle="--")
    _logarithmic(axes.xaxis)
    axes.set(ylim=(0, 103), xlabel="felt contrast dK/K [%]", ylabel="found [%]")
    axes.set_title(f"Weber fraction {fraction_text(estimate)}", loc="left")
