"""Result of a fit: values with intervals, residuals, the fitted scene."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import FitError
from palpate.figures import COLORS, empty_figure, write_figure
from palpate.fitting.measurements import Indentations
from palpate.fitting.statistics import Spread
from palpate.fitting.unknowns import Slot, Unknown, Unknowns, as_numbers
from palpate.input_file import require_writable
from palpate.scene import Scene

# Larger correlations mean that two numbers change together.
STRONGLY_CORRELATED = 0.95
# More names than these are not written into the picture.
MOST_NAMES = 8


@dataclass(frozen=True)
class FittedParameter:
    """A value of the scene after a fit.

    Attributes
    ----------
    name
        Its key in the scene, such as ``material.youngs_modulus``.
    value
        Pa, or no unit.
    low, high
        Ends of its interval; equal to the value where it was not fitted.
    fitted
        Whether it was.
    note
        Why not, or with what it changes.

    """

    name: str
    value: float
    low: float
    high: float
    fitted: bool
    note: str = ""

    def __str__(self) -> str:
        text = f"{self.name} = {_quantity(self.name, self.value)}"
        if self.fitted:
            text += f" ({_quantity(self.name, self.low)} to {_quantity(self.name, self.high)})"
        return f"{text}: {self.note}" if self.note else text


@dataclass(frozen=True, eq=False)
class Fit:
    """A material fitted to measured indentations.

    Attributes
    ----------
    parameters
        Values of the scene with their intervals; str() of one is a line.
    scene
        The scene with these values.
    measured
        Rows that were compared: of each curve those up to its largest depth.
    predicted
        (n,) N: force of the fitted scene at each of them.
    used
        (n,) whether a row lies within the law of the material.
    touch
        (curves,) m: depth at which each curve touches first; 0 unless it was fitted.
    points
        (curves, 3) m: where the tool pressed.
    names, correlation
        Numbers that were fitted, and their correlation (p, p).
    condition
        Ratio of the largest to the smallest singular value of the derivatives by these numbers, each scaled to one.
    inflation
        Factor by which variances were enlarged because neighbouring residuals agree.
    confidence
        Of the intervals.
    model_error
        Largest relative error of a force that the law of the scene states; it is not in the intervals.
    lost_energy
        Part of the work that did not come back, by curve, where unloading was measured: no elastic law has it.
    solved
        Number of bodies that were solved.

    """

    parameters: tuple[FittedParameter, ...]
    scene: Scene
    measured: Indentations
    predicted: np.ndarray
    used: np.ndarray
    touch: np.ndarray
    points: np.ndarray
    names: tuple[str, ...]
    correlation: np.ndarray
    condition: float
    inflation: float
    confidence: float
    model_error: float
    lost_energy: Mapping[str, float]
    solved: int
    _changes: tuple[tuple[Slot, dict[str, float]], ...] = field(default=(), repr=False)
    _source: Scene | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return f"Fit({'; '.join(str(p) for p in self.parameters if p.fitted)})"

    def __getitem__(self, name: str) -> FittedParameter:
        """Parameter by its key."""
        found = next((p for p in self.parameters if p.name == name), None)
        if found is None:
            raise FitError(f"there is no '{name}'; there are {', '.join(p.name for p in self.parameters)}")
        return found

    @property
    def residuals(self) -> np.ndarray:
        """(n,) N: measured force less that of the fitted scene."""
        return self.measured.force - self.predicted

    @property
    def scatter(self) -> float:
        """Root mean square of the residuals over the largest force."""
        return float(np.sqrt(np.mean(self.residuals[self.used] ** 2)) / np.abs(self.measured.force).max())

    @property
    def notes(self) -> tuple[str, ...]:
        """What limits the result, a sentence each."""
        found = []
        for i, j in zip(*np.triu_indices(len(self.names), 1), strict=True):
            if abs(self.correlation[i, j]) > STRONGLY_CORRELATED:
                pair = f"{self.names[i]} and {self.names[j]}"
                found.append(f"{pair} are correlated by {self.correlation[i, j]:.3f}: the data hardly separate them")
        if not self.used.all():
            found.append(f"{(~self.used).sum()} rows lie deeper than the law of the material reaches, and are left out")
        if self.inflation > 1.0:
            found.append("neighbouring residuals agree: the law does not follow the curve, and intervals are wider")
        if self.model_error > 0.03:
            found.append(f"the law states an error of its force up to {100 * self.model_error:.2g} %")
        for name, part in self.lost_energy.items():
            if part > 0.1:
                found.append(f"{name}: {100 * part:.0f} % of the work does not come back: no elastic law has that")
        return tuple(found)

    def picture(self, path: str | os.PathLike[str]) -> None:
        """Draw curves and residuals into a file, ``.png`` or ``.svg``.

        Raises
        ------
        FitError
            Another ending, or no place for a file.

        """
        path = Path(path)
        if path.suffix.lower() not in (".png", ".svg"):
            raise FitError(f"{path}: a picture ends in .png or .svg")
        require_writable(path, FitError)
        title = "; ".join(str(p) for p in self.parameters if p.fitted)[:90]
        picture_of_fit(self.measured, self.predicted, self.used, title, path)

    def write_scene(self, path: str | os.PathLike[str]) -> None:
        """Write the scene's file with the fitted values; all else in it, comments too, stays as it is.

        Raises
        ------
        FitError
            A scene that was not read from a file, or no place for one.

        """
        path = Path(path)
        text = "" if self._source is None else self._source.source[1]
        if not text:
            raise FitError("the scene was made by a program: read it from a file to write it")
        require_writable(path, FitError)
        write_fitted(text, self._changes, path)


def fitted_parameters(
    unknowns: Unknowns, free: Sequence[Unknown], vector: np.ndarray, spread: Spread, held: Mapping[str, str]
) -> tuple[tuple[FittedParameter, ...], np.ndarray]:
    """Values of the scene with intervals, by first order, and the correlation (p, p) of those that were fitted.

    Intervals of moduli are symmetric in the logarithm.
    """
    numbers = as_numbers(unknowns, free, vector)
    values = unknowns.values(numbers)
    count = len(free)
    names = list(values)
    derivative = np.zeros((len(names), count))
    step = 1e-5
    for rank in range(count):
        moved = vector.copy()
        moved[rank] += step
        after = unknowns.values(as_numbers(unknowns, free, moved))
        derivative[:, rank] = [(after[name] - values[name]) / step for name in names]
    covariance = spread.covariance[:count, :count]
    deviation = np.sqrt(np.einsum("ij,jk,ik->i", derivative, covariance, derivative))
    widths = spread.factor * deviation
    own = [names.index(u.name) for u in free]
    spreads = np.maximum(deviation[own], 1e-300)
    correlation = derivative[own] @ covariance @ derivative[own].T / spreads / spreads[:, None]
    found = []
    for name, width, moves in zip(names, widths, np.abs(derivative).max(axis=1, initial=0.0) > 0, strict=True):
        value = values[name]
        if name.endswith(("youngs_modulus", "c10")) and value > 0:
            low, high = value * np.exp(-width / value), value * np.exp(width / value)
        else:
            low, high = value - width, value + width
        note = held.get(name, "")
        if note and moves:
            note += ", beside material.youngs_modulus: its ratio to that is kept"
        elif note:
            note += ": kept"
        found.append(FittedParameter(name, float(value), float(low), float(high), bool(moves), note))
    return tuple(found), correlation


def _quantity(name: str, value: float) -> str:
    if name.endswith("poissons_ratio"):
        return f"{value:.4g}"
    scale, unit = next(
        pair for pair in ((1.0, "Pa"), (1e3, "kPa"), (1e6, "MPa")) if abs(value) < 1e3 * pair[0] or pair[0] == 1e6
    )
    return f"{value / scale:.4g} {unit}"


def write_fitted(text: str, changes: Sequence[tuple[Slot, dict[str, float]]], path: Path) -> None:
    """Write the text of a scene with other values of its materials, beside and renamed; comments and order stay."""
    import tomlkit

    document = tomlkit.parse(text)
    for slot, values in changes:
        table = _table_of(document, slot)
        for name, value in values.items():
            table[name] = round(value, 6) if name == "poissons_ratio" else _pressure(value)
    with written_beside(path) as partial:
        partial.write_text(tomlkit.dumps(document), encoding="utf-8")


def _table_of(document: Any, slot: Slot) -> Any:
    """Table of a slot: that of the body, if it has one, else that of the scene."""
    import tomlkit

    body = document.get("body", {})
    body = body[0] if isinstance(body, list) else body
    if slot.rank is not None:
        return (body if slot.key in body else document)[slot.key][slot.rank]
    if "material" in body:
        return body["material"]
    if "material" not in document:
        document["material"] = tomlkit.table()
    return document["material"]


def _pressure(value: float) -> str:
    return f"{value:.6g}Pa" if abs(value) < 1e3 else f"{1e-3 * value:.6g}kPa"


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
