"""Least squares of a scene's material to measured indentations."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from palpate.errors import FitError
from palpate.fitting.measurements import Indentations
from palpate.fitting.presses import Presses
from palpate.fitting.result import Fit, fitted_parameters
from palpate.fitting.statistics import Spread, spread_of
from palpate.fitting.unknowns import Unknown, Unknowns, as_numbers, chosen_to_fit
from palpate.scene import Scene

# The first touch lies at most this part of the depth away from where the data have it.
MOST_OFFSET = 0.1
MOST_STEPS = 40
# Changes of the logarithm of a region's modulus that are tried before the fit.
TRIED_RATIOS = (-2.0, -1.0, 1.0, 2.0)
POISSON = "material.poissons_ratio"


def fit(
    scene: Scene | str | os.PathLike[str],
    measured: Indentations | str | os.PathLike[str],
    *,
    hold: str | Sequence[str] = (),
    find_touch: bool = False,
    confidence: float = 0.95,
) -> Fit:
    """Fit the material of a scene to measured indentations, by least squares on the scene's own law.

    Young's modulus of ``[material]`` and of each region with one of its own, and constants of ``mooney-rivlin`` and
    ``yeoh``, are fitted as far as the data determine them. Poisson's ratio is, where its interval is narrow enough.

    Parameters
    ----------
    scene
        Body, supports, first tool (the indenter) and the material to begin with; or its file.
    measured
        Curves of force against depth; or a CSV file, see :meth:`palpate.Indentations.read`.
    hold
        Key or keys that stay as they are, such as ``"poissons_ratio"`` or ``"region.0.youngs_modulus"``.
    find_touch
        Whether the depth of first touch of each curve is fitted too.
    confidence
        Of the intervals.

    Returns
    -------
    Fit
        Values with their intervals, the fitted scene, residuals, and what the data cannot determine.

    Raises
    ------
    FitError
        A scene or data that cannot be fitted.
    Error
        As of :meth:`palpate.Scene.build`.

    """
    if not 0.5 <= confidence < 1:
        raise FitError(f"confidence must lie between 0.5 and 1, got {confidence:g}")
    read = scene if isinstance(scene, Scene) else Scene.read(scene)
    data = measured if isinstance(measured, Indentations) else Indentations.read(measured)
    unknowns = Unknowns(read)
    chosen = chosen_to_fit(unknowns, (hold,) if isinstance(hold, str) else hold)
    presses = Presses(unknowns, read, data.loading())
    try:
        return _Search(unknowns, presses, data, find_touch, confidence).run(chosen, read)
    finally:
        presses.close()


class _Search:
    """Fits the unknowns that the data determine, and holds the others."""

    def __init__(self, unknowns: Unknowns, presses: Presses, data: Indentations, find_touch: bool, confidence: float):
        self._unknowns, self._presses, self._confidence = unknowns, presses, confidence
        self._all, self._data = data, data.loading()
        self._find_touch = find_touch
        self._scale = float(np.abs(self._data.force).max())
        if not self._scale > 0:
            raise FitError("all forces are zero")
        start = as_numbers(unknowns, [], np.empty(0))
        curves = presses.curves(start)
        self._used = self._data.depth < curves.limit[self._data.curve]
        self._deepest = np.array([self._data.depth[self._data.curve == k].max() for k in range(len(self._data.names))])

    def run(self, chosen: Sequence[Unknown], scene: Scene) -> Fit:
        """Fit, hold what the data do not determine, and try Poisson's ratio last."""
        held: dict[str, str] = {}
        free = [u for u in chosen if u.name != POISSON]
        vector, spread = self._fit_what_is_told(free, held)
        ratio = next((u for u in chosen if u.name == POISSON), None)
        if ratio is not None:
            tried = [*free, ratio]
            start = np.concatenate([vector[: len(free)], [ratio.start], vector[len(free) :]])
            predicted = self._spread(tried, start).half_widths[len(free)]
            if predicted <= ratio.telling:
                vector, spread = self._fit_what_is_told(tried, held, start)
                free = tried
            else:
                held[POISSON] = f"the data determine it to within {predicted:.2g} only"
        if not self._used.any():
            raise FitError("the law of the material ends before the first row: press less deep")
        numbers = as_numbers(self._unknowns, free, vector)
        offsets = self._offsets(free, vector)
        parameters, correlation = fitted_parameters(self._unknowns, free, vector, spread, held)
        return Fit(
            parameters=parameters,
            scene=self._unknowns.scene_with(numbers),
            measured=self._data,
            predicted=self._presses.forces(numbers, offsets),
            used=self._used,
            touch=offsets,
            points=self._presses.points,
            names=tuple(u.name for u in free),
            correlation=correlation,
            condition=spread.condition,
            inflation=spread.inflation,
            confidence=self._confidence,
            model_error=self._presses.curves(numbers).error,
            lost_energy=self._all.lost_energy(),
            solved=self._presses.solved,
            _changes=tuple(self._unknowns.changes(numbers)),
            _source=scene,
        )

    def _fit_what_is_told(
        self, free: list[Unknown], held: dict[str, str], start: np.ndarray | None = None
    ) -> tuple[np.ndarray, Spread]:
        """Fit; as long as an interval is too wide, hold the widest and fit again. ``free`` loses what is held."""
        vector = start
        if vector is None:
            vector = self._with_best_ratios(free, np.array([u.start for u in free] + [0.0] * self._touches))
        while True:
            vector = self._solve(free, vector)
            spread = self._spread(free, vector)
            if not free:
                return vector, spread
            widths = spread.half_widths[: len(free)] / [u.telling for u in free]
            worst = int(np.argmax(widths))
            if not widths[worst] > 1.0:
                return vector, spread
            name, width = free[worst].name, spread.half_widths[worst]
            reach = f"a factor {np.exp(min(width, 20.0)):.2g}" if name.endswith("youngs_modulus") else f"{width:.2g}"
            held[name] = f"the data determine it to within {reach} only"
            del free[worst]
            vector = np.delete(vector, worst)

    @property
    def _touches(self) -> int:
        return len(self._data.names) if self._find_touch else 0

    def _offsets(self, free: Sequence[Unknown], vector: np.ndarray) -> np.ndarray:
        """Offset of each curve, m: the vector has it over the largest depth."""
        return vector[len(free) :] * self._deepest if self._find_touch else np.zeros(len(self._data.names))

    def _residuals(self, free: Sequence[Unknown], vector: np.ndarray) -> np.ndarray:
        forces = self._presses.forces(as_numbers(self._unknowns, free, vector), self._offsets(free, vector))
        return ((forces - self._data.force) / self._scale)[self._used]

    def _jacobian(self, free: Sequence[Unknown], vector: np.ndarray) -> np.ndarray:
        """Return derivatives of the residuals: exact where a number scales or shifts the curves, else differences."""
        numbers, offsets = as_numbers(self._unknowns, free, vector), self._offsets(free, vector)
        columns, here = [], self._residuals(free, vector)
        for rank, unknown in enumerate(free):
            if unknown.name == "material.youngs_modulus" and not self._presses.has_pad:
                columns.append((self._presses.forces(numbers, offsets) / self._scale)[self._used])
                continue
            step = unknown.step if vector[rank] + unknown.step <= unknown.high else -unknown.step
            moved = vector.copy()
            moved[rank] += step
            columns.append((self._residuals(free, moved) - here) / step)
        slopes = self._presses.slopes(numbers, offsets) if self._touches else np.empty(0)
        for curve in range(self._touches):
            shift = np.where(self._data.curve == curve, -slopes * self._deepest[curve], 0.0)
            columns.append((shift / self._scale)[self._used])
        return np.array(columns).T

    def _with_best_modulus(self, free: Sequence[Unknown], start: np.ndarray) -> np.ndarray:
        """Take the first modulus that fits best with all else as it is: forces are linear in it."""
        if not free or free[0].name != "material.youngs_modulus" or self._presses.has_pad:
            return start
        model = self._residuals(free, start) * self._scale + self._data.force[self._used]
        factor = (model @ self._data.force[self._used]) / (model @ model)
        moved = start.copy()
        if factor > 0:
            moved[0] = np.clip(start[0] + np.log(factor), free[0].low, free[0].high)
        return moved

    def _with_best_ratios(self, free: Sequence[Unknown], start: np.ndarray) -> np.ndarray:
        """Begin where the ratio of each region's modulus fits best: far from it the curves hardly depend on it."""
        best = self._with_best_modulus(free, start)
        for rank, unknown in enumerate(free):
            if rank == 0 or not unknown.name.endswith("youngs_modulus"):
                continue
            tried = [best]
            for change in TRIED_RATIOS:
                moved = best.copy()
                moved[rank] = np.clip(best[rank] + change, unknown.low, unknown.high)
                tried.append(self._with_best_modulus(free, moved))
            best = min(tried, key=lambda vector: float((self._residuals(free, vector) ** 2).sum()))
        return best

    def _solve(self, free: Sequence[Unknown], start: np.ndarray) -> np.ndarray:
        from scipy.optimize import least_squares

        if not len(start):
            return start
        low = np.array([u.low for u in free] + [-MOST_OFFSET] * self._touches)
        high = np.array([u.high for u in free] + [MOST_OFFSET] * self._touches)
        start = self._with_best_modulus(free, np.clip(start, low, high))
        inside = np.clip(start, low + 1e-9, high - 1e-9)
        solution = least_squares(
            lambda v: self._residuals(free, v),
            inside,
            jac=lambda v: self._jacobian(free, v),
            bounds=(low, high),
            x_scale=np.array([1.0 if np.isinf(u.telling) else u.telling for u in free] + [0.1] * self._touches),
            xtol=1e-5,
            ftol=1e-7,
            max_nfev=MOST_STEPS,
        )
        return solution.x

    def _spread(self, free: Sequence[Unknown], vector: np.ndarray) -> Spread:
        residuals = self._residuals(free, vector)
        if len(residuals) <= len(vector):
            raise FitError(f"{len(residuals)} rows cannot determine {len(vector)} numbers: measure more, or hold some")
        if not len(vector):
            return Spread(np.empty((0, 0)), 0.0, 1.0, 1.0)
        return spread_of(self._jacobian(free, vector), residuals, self._data.curve[self._used], self._confidence)
