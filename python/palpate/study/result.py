"""Result of a study: a table and its plots."""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.equality import ComparedByValue
from palpate.figures import COLORS, empty_figure, write_figure
from palpate.sessions.tables import write_csv, write_parquet
from palpate.study.answers import Answers
from palpate.study.cases import Case, Key

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Units of what may be varied, as they stand behind the name of a column.
UNITS = {"youngs_modulus": "Pa", "density": "kg_per_m3", "max_element_size": "m", "radius": "m", "pressure": "Pa"}
# A range this wide is drawn on a logarithmic axis.
WIDE = 5.0
# Beyond so many texts along an axis they are turned.
LEVEL_TEXTS = 4


@dataclass(frozen=True, eq=False, repr=False)
class StudyResult(ComparedByValue):
    """Answers of all bodies of a study. Compared by value, number by number; not hashable.

    Attributes
    ----------
    columns
        The table, a row for each press of each body: its number and name, the values that are varied (in SI units,
        which stand behind their names), and what it answered. A body that could not be solved has one row without
        numbers.
    varied
        Columns of the values that are varied.
    problems
        Why bodies could not be solved, by number.
    notes
        What there was to warn of, once each.
    name
        Of the study.
    resumed
        Bodies that were known before.

    """

    columns: dict[str, np.ndarray]
    varied: tuple[str, ...]
    problems: dict[int, str]
    notes: tuple[str, ...]
    name: str
    resumed: int = field(default=0, compare=False)

    @classmethod
    def of(cls, name: str, cases: Sequence[Case], answers: Sequence[Answers], resumed: int) -> StudyResult:
        """Put the answers of bodies together."""
        keys = list(dict.fromkeys(key for case in cases for key in case.keys))
        rows: list[dict[str, Any]] = []
        for case, answer in zip(cases, answers, strict=True):
            values = {column_name(key): _plain(case.value(key)) for key in keys}
            about = {"case": case.number, "name": case.name, "body": case.scene.bodies[0].title, **values}
            rows += [{**about, **row} for row in answer.rows or [{}]]
        problems = {case.number: a.problem for case, a in zip(cases, answers, strict=True) if a.problem}
        notes = tuple(dict.fromkeys(note for answer in answers for note in answer.notes))
        return cls(_columns(rows), tuple(map(column_name, keys)), problems, notes, name, resumed)

    def save(self, folder: Path) -> list[Path]:
        """Write the table as CSV, as Parquet if pyarrow is installed, and its picture; the files' paths."""
        csv, parquet, picture = (folder / f"study.{ending}" for ending in ("csv", "parquet", "png"))
        write_csv(self.columns, csv)
        written = [csv]
        if importlib.util.find_spec("pyarrow") is not None:
            write_parquet(self.columns, parquet, {"study": self.name, "varied": ", ".join(self.varied)})
            written.append(parquet)
        if len(self.problems) < len(np.unique(self.columns["case"])):
            write_figure(picture_of_study(self.columns, self.varied), picture)
            written.append(picture)
        return written


def column_name(key: Key) -> str:
    """Name of a varied value's column: its key, with the unit of the numbers."""
    unit = UNITS.get(key[-1])
    return ".".join(key) + (f"_{unit}" if unit else "")


def _plain(value: Any) -> Any:
    """Value of a table as a number, where it is one, or text."""
    if isinstance(value, (bool, int, float)):
        return float(value)
    if isinstance(value, (list, tuple)):
        return " ".join(str(_plain(entry)) for entry in value)
    return "" if value is None else str(value)


def _columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, np.ndarray]:
    """Columns of rows of which some lack what others have."""
    names = dict.fromkeys(name for row in sorted(rows, key=len, reverse=True) for name in row)
    columns = {}
    for name in names:
        values = [row.get(name) for row in rows]
        text = any(isinstance(value, str) for value in values)
        missing = "" if text else float("nan")
        filled = [missing if value is None else value for value in values]
        columns[name] = np.array([str(value) for value in filled] if text else filled)
    return columns


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
