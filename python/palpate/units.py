"""Quantities with units, read once at the edge; inside everything is SI."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from numbers import Real

import numpy as np

from palpate.errors import UnitError

LENGTH_UNITS = {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
PRESSURE_UNITS = {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": 6894.757293168}
DENSITY_UNITS = {"kg/m3": 1.0, "kg/m^3": 1.0, "g/cm3": 1e3, "g/cm^3": 1e3}
STIFFNESS_UNITS = {"N/m": 1.0, "N/mm": 1e3}
FORCE_UNITS = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
ACCELERATION_UNITS = {"m/s2": 1.0, "m/s^2": 1.0}
SPEED_UNITS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
MEMORY_UNITS = {"B": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "MiB": 2.0**20, "GiB": 2.0**30}
SHARE_UNITS = {"%": 0.01}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "min": 60.0}

# Characters of a wrong value that a message repeats.
LONGEST_SHOWN = 60

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.ASCII)


def quantity(value: str | float, units: dict[str, float], kind: str) -> float:
    """Read a number (SI) or text such as ``"4mm"``; the result is SI.

    Raises UnitError for what is no quantity, and for a unit that is not in ``units``; the message lists them.
    """
    if isinstance(value, Real) and not isinstance(value, (bool, np.bool_)):
        return to_float(value)
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        shown = f"'{value}'" if isinstance(value, str) else brief_repr(value)
        raise UnitError(f"{shown} is not {_article(kind)} {kind}: write a number and one of {', '.join(units)}")
    number, unit = float(match[1]), match[2]
    if unit == "":
        return number
    if unit not in units:
        raise UnitError(f"unknown unit '{unit}' in '{value}': {_article(kind)} {kind} is given in {', '.join(units)}")
    return number * units[unit]


def _article(noun: str) -> str:
    return "an" if noun[0] in "aeiou" else "a"


def to_float(value: Real) -> float:
    """Turn a number into a float; a whole number beyond the range of floats is infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def brief_repr(value: object) -> str:
    """Value as it is written in a message of one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def count_text(count: int, one: str, several: str | None = None) -> str:
    """Write a number with its noun, such as ``1 tool`` and ``2 tools``."""
    return f"{count} {one}" if count == 1 else f"{count} {several or one + 's'}"


def _reader(units: dict[str, float], kind: str, doc: str) -> Callable[[str | float], float]:
    """Make the reader of one kind of quantity."""

    def read(value: str | float) -> float:
        return quantity(value, units, kind)

    read.__doc__ = doc
    return read


length = _reader(LENGTH_UNITS, "length", "Length in m.")
pressure = _reader(PRESSURE_UNITS, "pressure", "Pressure or modulus in Pa.")
density = _reader(DENSITY_UNITS, "density", "Density in kg/m^3.")
stiffness = _reader(STIFFNESS_UNITS, "stiffness", "Stiffness in N/m.")
force = _reader(FORCE_UNITS, "force", "Force in N.")
acceleration = _reader(ACCELERATION_UNITS, "acceleration", "Acceleration in m/s^2.")
share = _reader(SHARE_UNITS, "share", "Share of a whole, 1 or 100 %.")
time = _reader(TIME_UNITS, "time", "Time in s.")
speed = _reader(SPEED_UNITS, "speed", "Speed in m/s.")
memory = _reader(MEMORY_UNITS, "memory size", "Memory in bytes.")


def length_scale(unit: str) -> float:
    """Metres in one ``unit``; UnitError for a unit that is not a length."""
    if unit not in LENGTH_UNITS:
        raise UnitError(f"unknown length unit '{unit}': use one of {', '.join(LENGTH_UNITS)}")
    return LENGTH_UNITS[unit]
