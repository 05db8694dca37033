"""CSV files as indenters export them: columns and units are found by the header."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.errors import FitError
from palpate.input_file import require_file
from palpate.units import FORCE_UNITS, LENGTH_UNITS, TIME_UNITS

FORCES = {**FORCE_UNITS, "uN": 1e-6, "nN": 1e-9, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605}
LENGTHS = {**LENGTH_UNITS, "nm": 1e-9}
# Words of a header by what the column holds, the most particular first: an export has displacement and indentation.
WORDS: dict[str, tuple[str, ...]] = {
    "force": ("normal force", "force", "load", "fz", "fn"),
    "depth": ("indentation", "depth", "penetration", "displacement", "extension", "compression", "travel", "position"),
    "time": ("time",),
    "place": ("place", "site", "location", "curve", "specimen", "test", "cycle"),
    "radius": ("radius",),
    "diameter": ("diameter",),
    "x": ("x",),
    "y": ("y",),
    "z": ("z",),
}
UNITS = {
    **{"force": FORCES, "depth": LENGTHS, "time": TIME_UNITS, "place": {}, "radius": LENGTHS, "diameter": LENGTHS},
    **{axis: LENGTHS for axis in "xyz"},
}
# Rows of text above the header that are read at most.
LONGEST_HEAD = 200
_UNIT = re.compile(r"[(\[{]\s*(.*?)\s*[)\]}]|/\s*([^\W\d_]+)\s*$")


@dataclass(frozen=True)
class _Column:
    """A column: its place from 0 on, its title, and its unit, which a header may leave out."""

    number: int
    title: str
    unit: str | None


def read_columns(
    path: Path, units: Mapping[str, str | None], titles: Mapping[str, str | None]
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the columns of a CSV file in SI units, and the name of each row's place.

    ``units`` and ``titles`` of ``force`` and ``depth`` are those that stand instead of the header's, or None.
    `Indentations.read` describes the file and the errors.
    """
    require_file(path, FitError)
    lines = _text(path).splitlines()
    parted, decimal = _separator(lines)
    table = [_cells(line, parted) for line in lines]
    head, columns = _header(path, table, titles)
    first = head + 1
    if first < len(table) and _is_row_of_units(table[first]):
        columns = {k: c if c.unit else _with_unit(c, table[first]) for k, c in columns.items()}
        first += 1
    scales = _scales(path, head, columns, units)
    values: dict[str, list[float]] = {name: [] for name in columns if name != "place"}
    places: list[str] = []
    for number, row in enumerate(table[first:], first):
        if not any(cell.strip() for cell in row):
            continue
        for name, column in values.items():
            column.append(_number(path, number, row, columns[name], decimal) * scales[name])
        if "place" in columns:
            places.append(row[columns["place"].number].strip() if columns["place"].number < len(row) else "")
    return {name: np.array(column) for name, column in values.items()}, places


def _text(path: Path) -> str:
    raw = path.read_bytes()
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", errors="replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _separator(lines: Sequence[str]) -> tuple[str, str]:
    """Separator and decimal sign: what parts most of the last lines, which hold numbers."""
    tail = [line for line in lines if line.strip()][-20:]
    for sign in (";", "\t"):
        if tail and all(sign in line for line in tail):
            comma = any(re.search(r"\d,\d", line) for line in tail) and not any("." in line for line in tail)
            return sign, "," if comma else "."
    # A row that was cut short has no comma.
    return ("," if 2 * sum("," in line for line in tail) > len(tail) else " "), "."


def _cells(line: str, parted: str) -> list[str]:
    if parted == " ":
        # A title such as "Force (N)" is one cell.
        return [cell for cell in re.split(r"\s+(?![(\[])", line.strip()) if cell]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=parted), [])]


def _header(
    path: Path, table: Sequence[Sequence[str]], asked: Mapping[str, str | None]
) -> tuple[int, dict[str, _Column]]:
    """Find the row of titles, and the columns by what they hold."""
    for number, row in enumerate(table[:LONGEST_HEAD]):
        found = {name: _column(path, number, row, name, asked.get(name)) for name in WORDS}
        if found["force"] is not None and found["depth"] is not None:
            return number, {name: column for name, column in found.items() if column is not None}
    named = [f"'{title}'" for title in asked.values() if title is not None]
    missing = f"with {' and '.join(named)}" if named else "with a force (or load) and a depth (or displacement)"
    raise FitError(f"{path}: no header {missing}: write one, such as 'Force (N), Depth (mm)', or name both columns")


def _column(path: Path, number: int, row: Sequence[str], name: str, asked: str | None) -> _Column | None:
    if asked is not None:
        chosen = [k for k, cell in enumerate(row) if asked.strip().lower() in (cell.lower(), _words(cell))]
        return _Column(chosen[0], row[chosen[0]], _unit(row[chosen[0]], name)) if chosen else None
    for word in WORDS[name]:
        chosen = [k for k, cell in enumerate(row) if re.search(rf"(?:^|\s){word}\d?(?:\s|$)", _words(cell))]
        # Speeds and rates are named after what changes.
        chosen = [k for k in chosen if not re.search(r"rate|speed|velocity|slope|max", _words(row[k]))]
        if len(chosen) > 1 and name in ("force", "depth"):
            titles = " and ".join(f"'{row[k]}'" for k in chosen)
            raise FitError(f"{path}, line {number + 1}: {titles} may both be the {name}: name one by --{name}-column")
        if chosen:
            return _Column(chosen[0], row[chosen[0]], _unit(row[chosen[0]], name))
    return None


def _words(title: str) -> str:
    """Title in small letters, without its unit."""
    return " ".join(re.sub(r"[_\W]+", " ", _UNIT.sub(" ", title)).lower().split())


def _unit(title: str, name: str) -> str | None:
    """Return the unit in a title: in brackets, behind a slash, or its last word if that is one."""
    match = _UNIT.search(title)
    if match is not None:
        return match[1] if match[1] is not None else match[2]
    last = re.split(r"[\s_]+", title.strip())[-1]
    return last if _plain_unit(last) in UNITS[name] and len(re.split(r"[\s_]+", title.strip())) > 1 else None


def _plain_unit(unit: str) -> str:
    plain = unit.strip().replace("µ", "u").replace("μ", "u")
    return {"micron": "um", "microns": "um", "sec": "s", "seconds": "s", "newton": "N", "gram": "gf"}.get(plain, plain)


def _is_row_of_units(row: Sequence[str]) -> bool:
    known = {unit for units in UNITS.values() for unit in units} | {""}
    cells = [_plain_unit(cell.strip("()[]{} ")) for cell in row]
    return any(cells) and all(cell in known for cell in cells)


def _with_unit(column: _Column, units: Sequence[str]) -> _Column:
    unit = units[column.number].strip("()[]{} ") if column.number < len(units) else ""
    return replace(column, unit=unit or None)


def _scales(path: Path, head: int, columns: Mapping[str, _Column], given: Mapping[str, str | None]) -> dict[str, float]:
    """Factor of each column to SI units."""
    scales = {}
    for name, column in columns.items():
        if name == "place":
            continue
        unit, where = given.get(name) or column.unit, f"{path}, line {head + 1}, column '{column.title}'"
        if unit is None and name == "time":
            unit = "s"
        if unit is None:
            option = f"--{name}-unit" if name in given else "a unit in its title"
            raise FitError(f"{where}: no unit: give {option}, such as {'N' if name == 'force' else 'mm'}")
        if _plain_unit(unit) not in UNITS[name]:
            raise FitError(f"{where}: unknown unit '{unit}'; known are {', '.join(UNITS[name])}")
        scales[name] = UNITS[name][_plain_unit(unit)]
    return scales


def _number(path: Path, line: int, row: Sequence[str], column: _Column, decimal: str) -> float:
    text = row[column.number] if column.number < len(row) else ""
    try:
        value = float(text.replace(",", ".") if decimal == "," else text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        shown = f"'{text}' is not a number" if text else "nothing"
        raise FitError(f"{path}, line {line + 1}, column '{column.title}': {shown}")
    return value
