"""Columns of a recording as CSV and Parquet: one row a tick, and one row a contact."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from palpate.atomic import written_beside
from palpate.errors import Error
from palpate.simulation import Recording

XYZ = ("x", "y", "z")
# Vectors of tools: property of the recording, name in the table, unit, components.
VECTORS = (
    ("positions", "position", "m", XYZ),
    ("orientations", "orientation", "", ("w", *XYZ)),
    ("velocities", "velocity", "m_per_s", XYZ),
    ("angular_velocities", "angular_velocity", "rad_per_s", XYZ),
    ("forces", "force", "N", XYZ),
    ("torques", "torque", "Nm", XYZ),
    ("computed_forces", "computed_force", "N", XYZ),
    ("computed_torques", "computed_torque", "Nm", XYZ),
    ("port_energy", "energy", "J", ("given", "owed", "unpaid")),
)
CONTACT_VECTORS = (("point", "m"), ("normal", ""), ("force", "N"), ("torque", "Nm"))
CONTACT_NUMBERS = (("radius", "m"), ("depth", "m"), ("stiffness", "N_per_m"), ("error", ""))
# Rows that are written at a time.
BLOCK = 5000

Report = Callable[[int, int], None] | None


def tick_columns(recording: Recording, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of some rows of a recording by name, with the unit in it."""
    ticks = len(recording.ticks)
    columns = {"tick": recording.ticks[rows], "time_s": recording.time[rows]}
    for name, unit in (("compute_us", "compute_us"), ("wakeup_us", "wakeup_us")):
        columns[unit] = getattr(recording, name)[rows]
    flags = {name: getattr(recording, name).reshape(ticks, -1)[rows] for name in ("active", "limited", "buttons")}
    vectors = {
        name: getattr(recording, source).reshape(ticks, -1, len(parts))[rows] for source, name, _, parts in VECTORS
    }
    for tool in range(flags["active"].shape[1]):
        columns |= {f"tool{tool}_{name}": values[:, tool] for name, values in flags.items()}
        for _, name, unit, parts in VECTORS:
            for axis, part in enumerate(parts):
                columns[_named(f"tool{tool}_{name}_{part}", unit)] = vectors[name][:, tool, axis]
    for body, energy in enumerate(recording.energies):
        for name in () if energy is None else ("kinetic", "strain", "coupling", "dissipated", "work"):
            columns[f"body{body}_{name}_J"] = getattr(energy, name)[rows]
    events = defaultdict(list)
    for tick, what in recording.events:
        events[tick].append(what)
    columns["events"] = np.array(["; ".join(events.get(tick, ())) for tick in columns["tick"].tolist()], dtype=object)
    return columns


def contact_columns(recording: Recording, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of the contacts in some rows of a recording."""
    contacts = recording.contacts
    at = np.searchsorted(recording.ticks, contacts["tick"])
    kept = np.isin(at, rows)
    contacts, at = contacts[kept], at[kept]
    columns = {"tick": contacts["tick"], "time_s": recording.time[at]}
    columns |= {name: contacts[name] for name in ("tool", "body", "grab", "slipping", "limited")}
    for name, unit in CONTACT_VECTORS:
        columns |= {_named(f"{name}_{part}", unit): contacts[name][:, axis] for axis, part in enumerate(XYZ)}
    return columns | {_named(name, unit): contacts[name] for name, unit in CONTACT_NUMBERS}


def write_csv(columns: Mapping[str, np.ndarray], path: Path, report: Report = None) -> None:
    """Write columns as CSV; every number reads back to the same bits."""
    rows = len(next(iter(columns.values())))
    with written_beside(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for start in range(0, rows, BLOCK):
            writer.writerows(zip(*(_texts(column[start : start + BLOCK]) for column in columns.values()), strict=True))
            if report is not None:
                report(min(start + BLOCK, rows), rows)


def write_parquet(columns: Mapping[str, np.ndarray], path: Path, about: Mapping[str, str]) -> None:
    """Write columns as Parquet, with what the recording says of itself in the metadata of the schema.

    Raises Error if pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise Error("Parquet needs pyarrow: pip install 'palpate[export]'") from None
    table = pyarrow.table({name: pyarrow.array(column) for name, column in columns.items()})
    table = table.replace_schema_metadata({f"palpate.{name}": value for name, value in about.items()})
    with written_beside(path) as partial:
        pyarrow.parquet.write_table(table, partial, compression="zstd")


def _named(name: str, unit: str) -> str:
    return f"{name}_{unit}" if unit else name


def _texts(column: np.ndarray) -> list[Any]:
    """Values as csv writes them: the shortest text that reads back to the same bits; 0 and 1 for flags."""
    if column.dtype == np.float32:
        return column.astype(str).tolist()
    return column.astype(int).tolist() if column.dtype == bool else column.tolist()
