"""Measured indentations: force against depth, at one place or several."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.equality import ComparedByValue
from palpate.errors import FitError
from palpate.fitting.csv_file import read_columns
from palpate.units import length
from palpate.vectors import number_array

# A press has reached its largest depth where it comes as close to it as this part of its range.
AT_DEEPEST = 0.002
FEWEST_ROWS = 5


@dataclass(frozen=True, eq=False, repr=False)
class Indentations(ComparedByValue):
    """Measured curves of force against depth. Compared by value; not hashable.

    Attributes
    ----------
    force, depth
        (n,) N and m, positive where the indenter presses; depth from first touch.
    curve
        (n,) number of the curve that a row belongs to, from 0 on.
    points
        (curves, 3) m: where each curve was measured, in the scene; None where the data have none.
    names
        Name of each curve.
    time
        (n,) s, or None.
    radius
        Radius of the indenter, m, where the data give it.

    """

    force: np.ndarray
    depth: np.ndarray
    curve: np.ndarray | None = None
    points: np.ndarray | None = None
    names: tuple[str, ...] = ()
    time: np.ndarray | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        rows = {"force": self.force, "depth": self.depth, "time": self.time}
        for name, values in rows.items():
            if values is not None:
                object.__setattr__(self, name, number_array(values, f"{name} of indentations", FitError).ravel())
        numbers = np.zeros(len(self.force)) if self.curve is None else number_array(self.curve, "curve", FitError)
        curve = np.nan_to_num(numbers, nan=-1).astype(int).ravel()
        object.__setattr__(self, "curve", curve)
        if len(self.depth) != len(self.force) or len(curve) != len(self.force):
            raise FitError(f"{len(self.force)} forces, {len(self.depth)} depths and {len(curve)} curves: give as many")
        if not len(self.force):
            raise FitError("indentations need rows of force and depth, got none")
        finite = np.isfinite(self.force) & np.isfinite(self.depth)
        if not finite.all():
            raise FitError(f"row {int(np.argmin(finite))} of the indentations is not finite")
        count = int(curve.max(initial=0)) + 1
        if set(np.unique(curve).tolist()) != set(range(count)):
            raise FitError(f"curves must be numbered from 0 to {count - 1}, each with rows")
        self._check_places(count)
        object.__setattr__(self, "names", self.names or tuple(f"curve {k + 1}" for k in range(count)))
        for k, name in enumerate(self.names):
            if (curve == k).sum() < FEWEST_ROWS or not self.depth[curve == k].max() > 0:
                raise FitError(f"{name} needs {FEWEST_ROWS} rows or more, and a depth above zero")

    def _check_places(self, curves: int) -> None:
        """Take the places of the curves, and the radius of the indenter; FitError for wrong ones."""
        if self.points is not None:
            points = np.atleast_2d(number_array(self.points, "points", FitError))
            if points.shape != (curves, 3) or not np.isfinite(points).all():
                raise FitError(f"points must be ({curves}, 3) finite numbers, one row a curve, got {points.shape}")
            object.__setattr__(self, "points", points)
        if self.radius is not None:
            object.__setattr__(self, "radius", length(self.radius))
            if not 0 < self.radius < np.inf:
                raise FitError(f"the radius of the indenter must be positive, got {self.radius:g} m")

    def __repr__(self) -> str:
        deepest = 1e3 * self.depth.max()
        return f"Indentations({len(self.names)} curves, {len(self.force)} rows, to {deepest:.3g} mm)"

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        force_unit: str | None = None,
        depth_unit: str | None = None,
        force_column: str | None = None,
        depth_column: str | None = None,
    ) -> Indentations:
        """Read a CSV file as indenters export it.

        The header names the columns with their units, such as ``Force (N)``, ``Displacement [mm]`` or ``Depth um``; a
        row of units may follow it. Columns of time, of a place's name, of its x, y and z, and of the indenter's radius
        or diameter are read where they are. Text before the header is skipped. Signs are turned so that pressing is
        positive.

        Parameters
        ----------
        path
            The file; cells are parted by comma, semicolon, tab or blanks, with a decimal comma where that is clear.
        force_unit, depth_unit
            Units of these columns, instead of those of the header.
        force_column, depth_column
            Titles of these columns, where the words of the header are others.

        Raises
        ------
        FitError
            No such file, columns or units that are not clear, or a cell that is no number, with its line.

        """
        units, titles = {"force": force_unit, "depth": depth_unit}, {"force": force_column, "depth": depth_column}
        return _assembled(Path(path), *read_columns(Path(path), units, titles))

    def loading(self) -> Indentations:
        """Return the rows up to the largest depth of each curve, in the order of time."""
        order = np.arange(len(self.force)) if self.time is None else np.argsort(self.time, kind="stable")
        kept = []
        for k in range(len(self.names)):
            rows = order[self.curve[order] == k]
            depth = self.depth[rows]
            nearly = depth.max() - AT_DEEPEST * np.ptp(depth)
            kept.append(rows[: int(np.argmax(depth >= nearly)) + 1])
        chosen = np.concatenate(kept)
        time = None if self.time is None else self.time[chosen]
        rows = (self.force[chosen], self.depth[chosen], self.curve[chosen])
        return Indentations(*rows, self.points, self.names, time, self.radius)

    def lost_energy(self) -> Mapping[str, float]:
        """Part of the work of each curve that does not come back while it is unloaded, where that was measured."""
        found = {}
        loaded = self.loading()
        for k, name in enumerate(self.names):
            rows = self.curve == k
            force, depth = self.force[rows], self.depth[rows]
            if self.time is not None:
                order = np.argsort(self.time[rows], kind="stable")
                force, depth = force[order], depth[order]
            work = np.trapezoid(loaded.force[loaded.curve == k], loaded.depth[loaded.curve == k])
            if depth[-1] < 0.3 * depth.max() and work > 0:
                found[name] = float(np.trapezoid(force, depth) / work)
        return found


def _assembled(path: Path, values: Mapping[str, np.ndarray], places: Sequence[str]) -> Indentations:
    """Put the columns together: curves by name or by place, signs so that pressing is positive."""
    if not len(values["force"]):
        raise FitError(f"{path}: no rows below the header")
    force, depth = (
        column if abs(column.max()) >= abs(column.min()) else -column for column in (values["force"], values["depth"])
    )
    axes = [values[axis] for axis in "xyz" if axis in values]
    if len(axes) not in (0, 3):
        raise FitError(f"{path}: a place needs the columns x, y and z, or none of them")
    keys = list(zip(places or [""] * len(force), *(axes or [np.zeros(len(force))]), strict=True))
    order = {key: rank for rank, key in enumerate(dict.fromkeys(keys))}
    names = tuple(str(key[0]) or f"curve {rank + 1}" for key, rank in order.items())
    points = np.array([key[1:] for key in order]) if axes else None
    radius = values["radius"] if "radius" in values else values["diameter"] / 2 if "diameter" in values else None
    if radius is not None and np.ptp(radius) > 0:
        raise FitError(f"{path}: more than one radius of the indenter: give each its own file")
    curve = np.array([order[key] for key in keys])
    try:
        one = None if radius is None else float(radius[0])
        return Indentations(force, depth, curve, points, names, values.get("time"), one)
    except FitError as error:
        raise FitError(f"{path}: {error}") from None
