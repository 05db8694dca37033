"""Result of a fit: values with intervals, residuals, the fitted scene."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.errors import FitError
from palpate.fitting.measurements import Indentations
from palpate.fitting.picture import picture_of_fit
from palpate.fitting.scene_file import write_fitted
from palpate.fitting.statistics import Spread
from palpate.fitting.unknowns import Slot, Unknown, Unknowns, as_numbers
from palpate.input_file import require_writable
from palpate.scene import Scene

# Larger correlations mean that two numbers change together.
STRONGLY_CORRELATED = 0.95


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
