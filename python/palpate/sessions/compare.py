"""Comparison of two recordings: differing quantities, by how much, and from which tick."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.simulation import Recording

# Numbers of a tool that go in, and those that come out: property, what it is called, unit.
INPUTS = (
    ("active", "in the scene", ""),
    ("positions", "position", "m"),
    ("orientations", "orientation", ""),
    ("velocities", "velocity", "m/s"),
    ("angular_velocities", "angular velocity", "rad/s"),
    ("buttons", "buttons", ""),
)
OUTPUTS = (
    ("forces", "force", "N"),
    ("torques", "torque", "N m"),
    ("computed_forces", "computed force", "N"),
    ("computed_torques", "computed torque", "N m"),
    ("port_energy", "energy at the port", "J"),
    ("limited", "limit of strain", ""),
)
ENERGIES = ("kinetic", "strain", "coupling", "dissipated", "work")
# What a recording says of itself that tells nothing of what was felt.
ASIDE = ("format", "scene", "folder", "keys", "shown", "clock")


@dataclass(frozen=True)
class QuantityDifference:
    """How a quantity differs between two recordings, over the ticks that both have.

    Attributes
    ----------
    of
        ``"tool 0"``, ``"body 1"``; empty for what is of the whole scene.
    quantity, unit
        What it is.
    is_input
        Whether it is an input, such as the pose of a hand, rather than a result.
    largest, rms
        Largest and root mean square of the magnitude of the difference.
    tick, time
        Of the largest; time in s since the recording began.
    first
        First tick in which any bit differs; None if all are the same.
    reference
        Largest magnitude of the quantity in the first recording.

    """

    of: str
    quantity: str
    unit: str
    is_input: bool
    largest: float
    rms: float
    tick: int
    time: float
    first: int | None
    reference: float


@dataclass(frozen=True)
class Comparison:
    """Two recordings compared.

    Attributes
    ----------
    ticks
        How many both have.
    counts
        How many each has.
    quantities
        One a quantity of a tool or body.
    settings
        Keys of scenes and settings that differ, with their values in both; None where one has none.

    """

    ticks: int
    counts: tuple[int, int]
    quantities: tuple[QuantityDifference, ...]
    settings: tuple[tuple[str, Any, Any], ...]

    @property
    def same(self) -> bool:
        """Whether both have the same ticks, with the same bits in all that went in and came out."""
        return self.counts == (self.ticks, self.ticks) and self.first is None

    @property
    def first(self) -> QuantityDifference | None:
        """The quantity that differs first, an input before others; None if none does."""
        differing = [row for row in self.quantities if row.first is not None]
        return min(differing, key=lambda row: (row.first, not row.is_input), default=None)


def compare(a: Recording | str | os.PathLike[str], b: Recording | str | os.PathLike[str]) -> Comparison:
    """Compare two recordings, or their files, tick by tick; times that computing took are left aside.

    Raises
    ------
    Error
        A file that cannot be read, or is no recording.

    """
    both = [one if isinstance(one, Recording) else Recording.load(Path(one)) for one in (a, b)]
    common, *rows = np.intersect1d(both[0].ticks, both[1].ticks, assume_unique=True, return_indices=True)
    pair = _Pair(both, rows, common)
    counts = (len(both[0].ticks), len(both[1].ticks))
    return Comparison(len(common), counts, tuple(pair.quantities()), tuple(differing_settings(*both)))


class _Pair:
    """Two recordings at the ticks that both have."""

    def __init__(self, both: list[Recording], rows: list[np.ndarray], ticks: np.ndarray):
        self._both, self._rows, self._ticks = both, rows, ticks
        self._time = both[0].time[rows[0]]
        self._tools = min(_by_tool(one, "active").shape[1] for one in both)

    def quantities(self) -> Iterator[QuantityDifference]:
        if len(self._ticks) == 0:
            return
        for names, is_input in ((INPUTS, True), (OUTPUTS, False)):
            for tool in range(self._tools):
                for source, quantity, unit in names:
                    a, b = (_by_tool(one, source)[rows, tool] for one, rows in zip(self._both, self._rows, strict=True))
                    yield self._difference(f"tool {tool}", quantity, unit, a, b, is_input)
        yield from self._contacts()
        yield from self._bodies()

    def _contacts(self) -> Iterator[QuantityDifference]:
        contacts = [one.contacts[np.isin(one.contacts["tick"], self._ticks)] for one in self._both]
        at = [np.searchsorted(self._ticks, rows["tick"]) for rows in contacts]
        for tool in range(self._tools):
            counts, forces = [], []
            for rows, where in zip(contacts, at, strict=True):
                own = rows["tool"] == tool
                counts.append(np.bincount(where[own], minlength=len(self._ticks)))
                total = np.zeros((len(self._ticks), 3))
                np.add.at(total, where[own], rows["force"][own].astype(float))
                forces.append(total)
            yield self._difference(f"tool {tool}", "contacts", "", *counts)
            yield self._difference(f"tool {tool}", "force of the contacts", "N", *forces)
        # All else that is said of contacts, where there are as many in both.
        counts = [np.bincount(where, minlength=len(self._ticks)) for where in at]
        alike = np.flatnonzero(counts[0] == counts[1])
        rows = [rows[np.isin(where, alike)] for rows, where in zip(contacts, at, strict=True)]
        other = np.array([a.tobytes() != b.tobytes() for a, b in zip(*rows, strict=True)], dtype=bool)
        changed = (counts[0] != counts[1]).astype(float)
        changed[np.searchsorted(self._ticks, rows[0]["tick"][other])] = 1.0
        yield self._difference("", "ticks with other contacts", "", np.zeros_like(changed), changed)

    def _bodies(self) -> Iterator[QuantityDifference]:
        for body, (a, b) in enumerate(zip(self._both[0].energies, self._both[1].energies, strict=False)):
            for name in () if a is None or b is None else ENERGIES:
                pair = (getattr(one, name)[rows] for one, rows in zip((a, b), self._rows, strict=True))
                yield self._difference(f"body {body}", f"{name} energy" if name != "work" else "work", "J", *pair)

    def _difference(
        self, of: str, quantity: str, unit: str, a: np.ndarray, b: np.ndarray, is_input: bool = False
    ) -> QuantityDifference:
        """Of values (t,) or (t, n)."""
        a, b = (np.asarray(values, dtype=float).reshape(len(self._ticks), -1) for values in (a, b))
        # As bits: zeros of two signs differ, and numbers that are not are the same if they are the same ones.
        differs = np.flatnonzero((a.view(np.uint64) != b.view(np.uint64)).any(axis=1))
        size = np.linalg.norm(np.nan_to_num(a) - np.nan_to_num(b), axis=1)
        worst = int(size.argmax())
        largest, rms = float(size[worst]), float(np.sqrt((size**2).mean()))
        first = int(self._ticks[differs[0]]) if len(differs) else None
        reference = float(np.linalg.norm(np.nan_to_num(a), axis=1).max())
        where = (int(self._ticks[worst]), float(self._time[worst]))
        return QuantityDifference(of, quantity, unit, is_input, largest, rms, *where, first, reference)


def differing_settings(a: Recording, b: Recording) -> Iterator[tuple[str, Any, Any]]:
    """Keys of scenes, versions, bodies and settings that differ, with their values in both."""
    yield from _differing(*(_description(one) for one in (a, b)))
    keys = [json.loads(one.about["keys"]) for one in (a, b)]
    for body, ((green, modes), (other, others)) in enumerate(zip(*keys, strict=False)):
        for what, was, now in (("mesh, material, supports or precision", green, other), ("modes", modes, others)):
            if was != now:
                yield f"body[{body}]: {what}", was and was[:12], now and now[:12]
    for was, now in zip(a.settings, b.settings, strict=False):
        if was != now:
            tick = min(was["tick"], now["tick"])
            for name, before, after in _differing(was, now):
                yield f"{name} from tick {tick} on", before, after
            return
    if len(a.settings) != len(b.settings):
        yield "changes of settings", len(a.settings) - 1, len(b.settings) - 1


def _description(recording: Recording) -> dict[str, Any]:
    """Collect what a recording says of itself and of its scene, by key."""
    own = {key: text for key, text in recording.about.items() if key not in ASIDE}
    return own | _flat(json.loads(recording.about["scene"]))


def _differing(a: dict[str, Any], b: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for key in dict.fromkeys((*a, *b)):
        if a.get(key) != b.get(key):
            yield key, a.get(key), b.get(key)


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Leaves of tables within tables, by a name such as ``body[0].material.youngs_modulus``."""
    if isinstance(value, dict):
        parts = [(f"{name}.{key}" if name else key, inner) for key, inner in value.items()]
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        parts = [(f"{name}[{rank}]", inner) for rank, inner in enumerate(value)]
    else:
        return {name: value}
    return {key: leaf for part, inner in parts for key, leaf in _flat(inner, part).items()}


def _by_tool(recording: Recording, source: str) -> np.ndarray:
    """Column (t, tools, n) of a recording."""
    single = json.loads(recording.about["shown"])[1]
    values = getattr(recording, source)
    values = values[:, None] if single else values
    return values.reshape(*values.shape[:2], -1)
